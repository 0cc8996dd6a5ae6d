"""What a driver offers so that a profile can name it: its options, and how it is made from them.

A driver is a class with the attributes below, registered by name (see `drivers.registry`). Its `Options`
are the keys of its table in the profile beside `driver`, checked strictly before anything is made.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, runtime_checkable

from pydantic import BaseModel

from drivers.axis import AxisController, AxisSpec
from drivers.camera import CameraSource, CameraSpec
from drivers.clock import Clock

if TYPE_CHECKING:
    from drivers.simulated.world import SimulatedWorld


@dataclass(frozen=True, slots=True)
class DriverContext:
    """What a rig gives all of its drivers."""

    clock: Clock
    world: "SimulatedWorld | None" = None
    """The world behind simulated devices; None where the devices are real."""


class ControllerDriver(Protocol):
    """A class that makes the controllers of one make of device."""

    Options: ClassVar[type[BaseModel]]
    """Keys of the profile's `[controllers.NAME]` beside `driver`."""
    AxisOptions: ClassVar[type[BaseModel]]
    """The driver's own keys of one axis, such as the channel that it is wired to."""

    @classmethod
    def create(
        cls,
        specs: Mapping[str, AxisSpec],
        options: Any,  # an instance of Options; Any, since a protocol cannot name each driver's own model
        axis_options: Mapping[str, Any],
        context: DriverContext,
    ) -> AxisController:
        """Make a controller that is not open yet, of the axes `specs`; `axis_options` has the same keys.

        Raises OptionsError where the options do not fit each other, the axes or the rig.
        """
        ...


class CameraDriver(Protocol):
    """A class that makes the cameras of one make."""

    Options: ClassVar[type[BaseModel]]
    """Keys of the profile's camera table beside `driver` and those of `CameraSpec`."""

    @classmethod
    def create(cls, spec: CameraSpec, options: Any, context: DriverContext) -> CameraSource:
        """Make a camera that is not open yet. Raises OptionsError where the options do not fit."""
        ...


@runtime_checkable
class Cautious(Protocol):
    """A controller or camera that has something to say of the device it found. Others need not be one."""

    @property
    def warnings(self) -> Sequence[str]:
        """Sentences on what is not as the profile asks or as a calibration needs it, since `open`."""
        ...
