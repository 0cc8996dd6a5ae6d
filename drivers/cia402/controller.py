"""The controller of CiA 402 drives: one CAN bus with its nodes."""

import asyncio
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import ClassVar, Final, Self

from drivers.axis import AxisSpec
from drivers.cancellation import finish
from drivers.cia402.axis import Cia402Axis
from drivers.cia402.drive import Drive
from drivers.cia402.link import Link, Network
from drivers.cia402.options import Cia402AxisOptions, Cia402Options
from drivers.cia402.sampling import Sampler
from drivers.clock import Clock
from drivers.driver import DriverContext
from drivers.errors import DeviceLostError, OptionsError

_LOOK: Final = 0.01
"""Seconds between two looks whether the drives have come up."""


class Cia402Controller:
    """Drives on one CAN bus; see `drivers.axis.AxisController`."""

    Options: ClassVar[type[Cia402Options]] = Cia402Options
    AxisOptions: ClassVar[type[Cia402AxisOptions]] = Cia402AxisOptions

    def __init__(
        self,
        specs: Mapping[str, AxisSpec],
        options: Cia402Options,
        axis_options: Mapping[str, Cia402AxisOptions],
        clock: Clock,
    ) -> None:
        self._options = options
        self._clock = clock
        self._link = Link(options, [axis_options[name].node for name in specs])
        self._sampler = Sampler(self._link, clock, options.silence / 4)
        self._drives = {
            name: Drive(name, axis_options[name].node, self._link, self._sampler, clock) for name in specs
        }
        self._axes = {
            name: Cia402Axis(spec, axis_options[name], self._drives[name], clock)
            for name, spec in specs.items()
        }

    @classmethod
    def create(
        cls,
        specs: Mapping[str, AxisSpec],
        options: Cia402Options,
        axis_options: Mapping[str, Cia402AxisOptions],
        context: DriverContext,
    ) -> Self:
        """Make a controller that is not open yet; raises OptionsError where two axes have one node."""
        nodes = {name: axis_options[name].node for name in specs}
        if len({*nodes.values(), options.own_node}) <= len(nodes):
            raise OptionsError(
                f"every axis on the CAN bus '{options.channel}' needs a node of its own, and none that is "
                f"'own_node' ({options.own_node}): they have {nodes}"
            )
        return cls(specs, options, axis_options, context.clock)

    @property
    def axes(self) -> Mapping[str, Cia402Axis]:
        """The axes by their names in the profile."""
        return MappingProxyType(self._axes)

    @property
    def warnings(self) -> Sequence[str]:
        """What is not as it should be, since `open`."""
        return [
            f"{drive.name} has no objects 0x1016 and 0x6007 by which it would stop when activecam or the bus fails: "
            "keep its emergency stop at hand"
            for drive in self._drives.values()
            if not drive.guarded
        ]

    async def open(self) -> None:
        """Take the bus, find the drives and set them up; moves nothing.

        Raises DeviceLostError; DeviceFaultError where a drive refuses, and OptionsError where it does not fit.
        """
        await self._link.open()
        try:
            self._sampler.open({drive.node: drive.sample_singly for drive in self._drives.values()})
            await self._link.ask(self._configure)
            await self._wait_for_heartbeats()
        except BaseException:
            await finish(self._let_go())
            raise

    async def close(self) -> None:
        """Stop the axes, switch their motors off where that can be had, and let the bus go."""
        try:
            await finish(self._stop_all())
        finally:
            await finish(self._let_go())

    def _configure(self, network: Network) -> None:
        network.beat(self._options.own_node, self._options.heartbeat)
        for axis in self._axes.values():
            axis.configure(network)
        # Only when all are there: a drive that was started stops as soon as activecam gives up.
        for drive in self._drives.values():
            drive.start(self._options.own_node, self._options.heartbeat)

    async def _wait_for_heartbeats(self) -> None:
        until = self._clock.now() + self._options.silence
        for drive in self._drives.values():
            while not drive.pulse.beats:
                if self._clock.now() >= until:
                    raise DeviceLostError(f"{drive.name} does not become operational: check its heartbeat")
                await self._clock.sleep(_LOOK)
            drive.require_alive()

    async def _stop_all(self) -> None:
        # A drive that is lost cannot be stopped, and the bus must be let go all the same.
        await asyncio.gather(*(axis.stop() for axis in self._axes.values()), return_exceptions=True)
        await asyncio.gather(
            *(self._link.ask(drive.release) for drive in self._drives.values()), return_exceptions=True
        )

    async def _let_go(self) -> None:
        await self._sampler.close()
        await self._link.close()
