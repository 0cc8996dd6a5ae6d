"""Devices without the devices: they speak bytes and frames as the real ones were seen to, and act in one world.

emulator    what an emulator is, and the faults that it has on request
registry    which driver's device has one
control     faults by lines of text
camera      a network camera, MJPEG over HTTP
"""
