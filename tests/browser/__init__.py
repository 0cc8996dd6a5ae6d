"""The technician's page in a real Chromium, before a daemon of its own.

They need `chromium`, and for the accessibility checks `npm`; where these are not installed they are skipped, but not
in the gate.
"""
