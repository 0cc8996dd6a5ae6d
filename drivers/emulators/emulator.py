"""What an emulator is: a device that is there from `start` to `close`, and misbehaves on request."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, Self, runtime_checkable

from drivers.axis import AxisSpec
from drivers.camera import CameraSpec
from drivers.driver import DriverContext


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that a device can be told to do wrong, or to undo."""

    sentence: str
    """What happens then, for people."""
    inject: Callable[..., None]
    """Called with the words that follow the fault's name; raises ValueError where they do not fit."""
    words: str = ""
    """What these are, such as "AXIS MM"."""


@runtime_checkable
class Emulator(Protocol):
    """One device of a profile, run by the event loop that `start` was called in."""

    @property
    def faults(self) -> Mapping[str, Fault]:
        """What it can be told to do wrong, by name."""
        ...

    async def start(self) -> Mapping[str, object]:
        """Be there. Return the keys of the device's table in the profile by which its driver finds it."""
        ...

    async def close(self) -> None:
        """Be gone, and let go of ports and tasks."""
        ...


class ControllerEmulator(Emulator, Protocol):
    """A device that drives axes of the context's world."""

    @classmethod
    def create(
        cls,
        specs: Mapping[str, AxisSpec],
        options: Any,
        axis_options: Mapping[str, Any],
        context: DriverContext,
    ) -> Self:
        """Make what the driver with these arguments would talk to. Raises OptionsError."""
        ...


class CameraEmulator(Emulator, Protocol):
    """A device that looks at the context's world."""

    @classmethod
    def create(cls, spec: CameraSpec, options: Any, context: DriverContext) -> Self:
        """Make what the driver with these arguments would talk to. Raises OptionsError."""
        ...
