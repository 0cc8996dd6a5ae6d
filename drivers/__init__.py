"""Ports to the world: axes and cameras, their contract, and the simulated world behind the mocks."""
