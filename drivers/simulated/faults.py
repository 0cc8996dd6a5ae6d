"""What simulated devices can be told to do wrong."""

from typing import Annotated, Literal

from pydantic import Field

from drivers.options import DriverOptions

AxisFault = Literal["stall", "hang"]
"""`stall`: the next motion ends half way. `hang`: the next motion never reports its end."""

DeviceFault = Literal["lost", "mute", "late", "alarm"]
"""`lost`: unplugged, without power. `mute`: there, but it answers nothing. `late`: it answers when it is almost
taken for lost. `alarm`: it has forgotten where it is and refuses to move until it is homed or repaired."""

CameraFault = Literal["lost", "frozen", "late"]
"""`lost`: unplugged. `frozen`: no new frames. `late`: every frame is delivered long after its exposure."""


class PlannedFault(DriverOptions):
    """A fault that happens in the course of an axis's n-th motion, homing and jogs included."""

    fault: AxisFault | DeviceFault
    axis: str
    motion: Annotated[int, Field(ge=1)] = 1
