"""The rig: devices and their owners, the snapshot that everybody reads, and the stop that nothing holds up.

In the order in which a state travels:

    devices           profile -> drivers, clock, simulated world
    device_owner      connecting, losing and finding a device;  controller_owner, camera_owner  the two kinds
    snapshot          what is known at one instant;  utc  its time stamps in UTC;  history  past instants
    wording           a loss in a sentence that names each device once
    stop_latch        nothing moves after a stop before it is acknowledged
    rig               all of it together
"""

from daemon.rig.controller_owner import Permit
from daemon.rig.devices import Devices, make_devices
from daemon.rig.history import PastReadings
from daemon.rig.rig import Rig
from daemon.rig.snapshot import AxisSnapshot, DeviceSnapshot, RigSnapshot, Side

__all__ = [
    "AxisSnapshot",
    "DeviceSnapshot",
    "Devices",
    "PastReadings",
    "Permit",
    "Rig",
    "RigSnapshot",
    "Side",
    "make_devices",
]
