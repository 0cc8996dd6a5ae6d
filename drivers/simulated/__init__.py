"""The simulated rig: a world with true axes, lens and plate, and the devices that act on it and look at it.

The world is described in the profile's `[simulation]` table and known to no other room: what is calibrated
against it shares no formula with it.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from drivers.simulated.camera import SimulatedCamera as SimulatedCamera
    from drivers.simulated.controller import SimulatedController as SimulatedController
    from drivers.simulated.options import SimulationOptions as SimulationOptions
    from drivers.simulated.world import SimulatedWorld as SimulatedWorld

__all__ = ["SimulatedCamera", "SimulatedController", "SimulatedWorld", "SimulationOptions"]

_HOMES = {
    "SimulatedCamera": "drivers.simulated.camera",
    "SimulatedController": "drivers.simulated.controller",
    "SimulatedWorld": "drivers.simulated.world",
    "SimulationOptions": "drivers.simulated.options",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for: reading a profile needs the options, and not the renderer's libraries."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
