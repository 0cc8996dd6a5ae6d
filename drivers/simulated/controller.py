"""The simulated motor controller: one device that drives axes of the simulated world."""

import contextlib
import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Annotated, ClassVar, Self

from pydantic import Field

from drivers.axis import AxisSpec
from drivers.cancellation import finish
from drivers.clock import Clock
from drivers.driver import DriverContext
from drivers.errors import DriverError, OptionsError
from drivers.options import DriverOptions
from drivers.quantities import PositiveDuration, in_reading_unit, written
from drivers.simulated.axis import SimulatedAxis
from drivers.simulated.device import Device
from drivers.simulated.faults import AxisFault, DeviceFault, PlannedFault
from drivers.simulated.options import ReadingText
from drivers.simulated.world import SimulatedWorld


class SimulatedControllerOptions(DriverOptions):
    """Keys of `[controllers.NAME]` with `driver = "simulated"`."""

    answer_timeout: PositiveDuration = written("1 s")
    """How long a device may keep silent before it counts as lost."""
    faults: Annotated[tuple[PlannedFault, ...], Field(strict=False)] = ()


class SimulatedAxisOptions(DriverOptions):
    """The simulated driver's own keys of one axis."""

    home_position: ReadingText | None = None
    """Where the home switch is; 0, or the limit nearest to it, where not given."""
    power_up_position: ReadingText | None = None
    """Where the axis stands, unknown to the device, before it is homed; by default amid its travel."""


class SimulatedController:
    """Drives axes of the simulated world. Its faults are injected by `inject` and undone by `repair`."""

    Options: ClassVar[type[SimulatedControllerOptions]] = SimulatedControllerOptions
    AxisOptions: ClassVar[type[SimulatedAxisOptions]] = SimulatedAxisOptions

    def __init__(
        self,
        specs: Mapping[str, AxisSpec],
        options: SimulatedControllerOptions,
        axis_options: Mapping[str, SimulatedAxisOptions],
        world: SimulatedWorld,
        clock: Clock,
    ) -> None:
        self._device = Device(clock, options.answer_timeout)
        for planned in options.faults:
            if planned.axis not in specs:
                raise OptionsError(
                    f"a planned fault names axis '{planned.axis}': this controller drives {', '.join(specs)}"
                )
        self._axes = {
            name: self._make_axis(spec, axis_options[name], options.faults, world)
            for name, spec in specs.items()
        }

    @classmethod
    def create(
        cls,
        specs: Mapping[str, AxisSpec],
        options: SimulatedControllerOptions,
        axis_options: Mapping[str, SimulatedAxisOptions],
        context: DriverContext,
    ) -> Self:
        """Make a controller that is not open yet; raises OptionsError where there is no simulated world."""
        if context.world is None:
            raise OptionsError(
                "the driver 'simulated' needs a world: add a [simulation] table to the profile"
            )
        return cls(specs, options, axis_options, context.world, context.clock)

    @property
    def axes(self) -> Mapping[str, SimulatedAxis]:
        """The axes by their names in the profile."""
        return MappingProxyType(self._axes)

    async def open(self) -> None:
        """Connect. Raises DeviceLostError while the device is unplugged."""
        self._device.connect()

    async def close(self) -> None:
        """Stop all axes at once, wait until they stand, and disconnect."""
        try:
            await finish(self._stop_all())
        finally:
            self._device.disconnect()

    def inject(self, fault: AxisFault | DeviceFault, axis: str | None = None) -> None:
        """Let the device go wrong now, or with "stall" and "hang" the next motion of `axis`."""
        match fault:
            case "stall" | "hang":
                if axis is None:
                    raise ValueError(f"'{fault}' is a fault of one axis: name it")
                self._axes[axis].inject(fault)
            case "lost" | "mute" | "late" | "alarm":
                self._device.fail(fault)

    def repair(self) -> None:
        """Undo whatever was injected; a device that was lost has to be opened again, and its axes homed."""
        self._device.repair()

    async def _stop_all(self) -> None:
        if not self._device.opened:
            return
        for axis in self._axes.values():
            axis.brake()
        for axis in self._axes.values():
            with contextlib.suppress(DriverError):
                await axis.stop()

    def _make_axis(
        self,
        spec: AxisSpec,
        options: SimulatedAxisOptions,
        faults: Sequence[PlannedFault],
        world: SimulatedWorld,
    ) -> SimulatedAxis:
        low, high = spec.limits
        home = min(max(0.0, low), high)
        power_up = (low + high) / 2
        try:
            if options.home_position is not None:
                home = in_reading_unit(options.home_position, spec.unit)
            if options.power_up_position is not None:
                power_up = in_reading_unit(options.power_up_position, spec.unit)
            spec.check_target(home)
        except ValueError as error:
            raise OptionsError(f"axis '{spec.name}': {error}") from error
        index, shaft = world.shaft(spec.name)
        shaft.place(power_up, -math.inf)
        return SimulatedAxis(
            spec,
            shaft,
            self._device,
            home_position=home,
            seed=(world.options.seed, index),
            planned={planned.motion: planned.fault for planned in faults if planned.axis == spec.name},
        )
