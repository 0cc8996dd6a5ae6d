"""Which driver's device has an emulator. Nothing is imported before one is asked for."""

from collections.abc import Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Final, cast

from drivers.emulators.emulator import CameraEmulator, ControllerEmulator
from drivers.errors import OptionsError
from drivers.registry import DriverKind

EMULATORS: Final[Mapping[DriverKind, Mapping[str, str]]] = MappingProxyType(
    {
        "controllers": {
            "cia402": "drivers.emulators.cia402.emulator:Cia402Emulator",
            "grbl": "drivers.emulators.grbl:GrblEmulator",
        },
        "cameras": {
            "stream": "drivers.emulators.camera:StreamEmulator",
            "v4l2": "drivers.emulators.camera:StreamEmulator",
        },
    }
)
"""By the driver's name, `module:Class`."""


def has_emulator(table: str, driver: str) -> bool:
    """Return whether `activecam simulate` can stand in for what a table of the profile names."""
    return driver in EMULATORS["cameras" if table == "camera" else "controllers"]


def controller_emulator(driver: str) -> type[ControllerEmulator]:
    """Return the class that stands in for the devices of a driver. Raises OptionsError."""
    return cast(type[ControllerEmulator], _load("controllers", driver))


def camera_emulator(driver: str) -> type[CameraEmulator]:
    """Return the class that stands in for the cameras of a driver. Raises OptionsError."""
    return cast(type[CameraEmulator], _load("cameras", driver))


def _load(kind: DriverKind, driver: str) -> object:
    if driver not in EMULATORS[kind]:
        raise OptionsError(
            f"there is no emulator for the driver '{driver}' of {kind}, only for "
            f"{', '.join(sorted(EMULATORS[kind]))}: a profile whose devices are all 'simulated' is served as it is"
        )
    module, _, name = EMULATORS[kind][driver].partition(":")
    return getattr(import_module(module), name)
