"""Servo drives on a CAN bus that follow CiA 402, over `canopen` and `python-can`.

options      what a profile says
objects      the drive's objects that are used, as `canopen` wants them
statusword   the state that a drive is in, and what to command it on its way to another
error_codes  why a drive stopped, in words
units        from the drive's units to the axis's reading unit
link         the bus: one thread that asks, another one for stops, and how its loss is noticed
sampling     positions, velocities and states of all drives at one instant
drive        one node: its objects, its controlword, whether it lives
axis         the motions
controller   the bus with its axes
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from drivers.cia402.controller import Cia402Controller as Cia402Controller

__all__ = ["Cia402Controller"]


def __getattr__(name: str) -> Any:
    """Import the driver when it is asked for: listing drivers needs no CAN library."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from drivers.cia402.controller import Cia402Controller

    return Cia402Controller
