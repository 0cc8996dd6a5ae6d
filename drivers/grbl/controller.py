"""A controller that speaks Grbl, with its axes."""

import asyncio
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import ClassVar, Self

from drivers.axis import AxisSpec
from drivers.cancellation import finish
from drivers.driver import DriverContext
from drivers.errors import OptionsError
from drivers.grbl.axis import GrblAxis
from drivers.grbl.machine import Machine
from drivers.grbl.options import GrblAxisOptions, GrblOptions


class GrblController:
    """A serial stepper table; see `drivers.axis.AxisController`.

    Its axes move one after the other: Grbl carries out its lines in order, a stop ends all of them, and the
    speed of a line through mm and degrees at once means nothing. Stopping an axis that stands does not end
    the motion of another one.
    """

    Options: ClassVar[type[GrblOptions]] = GrblOptions
    AxisOptions: ClassVar[type[GrblAxisOptions]] = GrblAxisOptions

    def __init__(self, machine: Machine, axes: Mapping[str, GrblAxis]) -> None:
        self._machine = machine
        self._axes = axes

    @classmethod
    def create(
        cls,
        specs: Mapping[str, AxisSpec],
        options: GrblOptions,
        axis_options: Mapping[str, GrblAxisOptions],
        context: DriverContext,
    ) -> Self:
        """Make a controller that is not open yet. Raises OptionsError where axes share a letter, or a unit is off."""
        letters = {name: axis_options[name].letter for name in specs}
        if len(set(letters.values())) < len(letters):
            raise OptionsError(f"two axes at {options.port} have the same letter: {letters}")
        machine = Machine(specs, options, axis_options, context.clock)
        axes = {
            name: GrblAxis(spec, axis_options[name], options, machine, context.clock)
            for name, spec in specs.items()
        }
        return cls(machine, axes)

    @property
    def axes(self) -> Mapping[str, GrblAxis]:
        """The axes by their names in the profile."""
        return MappingProxyType(self._axes)

    @property
    def warnings(self) -> Sequence[str]:
        """What is set otherwise than it is best."""
        return self._machine.warnings

    async def open(self) -> None:
        """Connect, restart the controller, and check its settings; moves nothing.

        Raises DeviceLostError, and DeviceFaultError where it is not set as the profile needs.
        """
        await self._machine.open()

    async def close(self) -> None:
        """Stop the axes, see that they stand, and let the port go."""
        try:
            await finish(self._stop_all())
        finally:
            await finish(self._machine.close())

    async def _stop_all(self) -> None:
        # A controller that is lost cannot be stopped, and must be let go all the same.
        await asyncio.gather(*(axis.stop() for axis in self._axes.values()), return_exceptions=True)
