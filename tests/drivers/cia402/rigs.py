"""A CAN bus with two emulated drives on it, the controller that drives them, and a tap that hears all."""

import asyncio
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from itertools import count
from typing import Any

import can

from drivers.axis import AxisSpec
from drivers.cia402.axis import Cia402Axis
from drivers.cia402.controller import Cia402Controller
from drivers.cia402.options import Cia402AxisOptions, Cia402Options
from drivers.driver import DriverContext
from drivers.emulators.cia402.emulator import Cia402Emulator
from drivers.simulated.options import SimulationOptions
from drivers.simulated.world import SimulatedWorld
from tests.drivers import rigs
from tests.drivers.clocks import PatientClock

SLIDE = AxisSpec("slide", "prismatic", "mm", (-20.0, 20.0), 60.0, 600.0, 0.01)
"""Its drive counts micrometres, and says so."""
PAN = AxisSpec("pan", "revolute", "deg", (-20.0, 20.0), 60.0, 600.0, 0.01)
"""Its drive counts increments of its encoder."""

_channels = count()


class Rig:
    """The emulator and the controller of one bus."""

    def __init__(self, slide: dict[str, Any], pan: dict[str, Any], **options: Any) -> None:
        clock = PatientClock()
        specs = {"slide": SLIDE, "pan": PAN}
        # Drives and driver share this program: a loss is waited for by tests that want one.
        options = {"interface": "virtual", "channel": f"test-{next(_channels)}", "silence": "4 s"} | options
        axes = {
            "slide": Cia402AxisOptions.model_validate({"node": 1} | slide),
            "pan": Cia402AxisOptions.model_validate({"node": 2} | pan),
        }
        world = SimulatedWorld(
            SimulationOptions.model_validate({"camera": rigs.camera_truth(), "joints": rigs.joint_truths()}),
            [SLIDE, PAN],
            rigs.TARGETS["circle_grid"],
            clock,
        )
        self.clock = clock
        self.world = world
        self._specs, self._options, self._axes = specs, options, axes
        self.emulator = Cia402Emulator.create(
            specs, Cia402Options.model_validate(options), axes, DriverContext(clock, world)
        )

    async def start(self) -> Cia402Controller:
        """Switch the drives on, and return a controller for them that is not open yet."""
        return self.connect(**await self.emulator.start())

    def connect(self, **found: Any) -> Cia402Controller:
        """Return a controller that finds the drives by these keys."""
        options = Cia402Options.model_validate(self._options | found)
        self.controller = Cia402Controller.create(self._specs, options, self._axes, DriverContext(self.clock))
        return self.controller

    @contextmanager
    def tap(self) -> Iterator["Tap"]:
        """Listen to the bus, a virtual one."""
        with can.Bus(interface="virtual", channel=self._options["channel"]) as bus:
            yield Tap(bus)

    @property
    def slide(self) -> Cia402Axis:
        return self.controller.axes["slide"]

    @property
    def pan(self) -> Cia402Axis:
        return self.controller.axes["pan"]

    def reading(self, axis: str) -> float:
        """Where the motor truly is."""
        return self.world.shaft(axis)[1].motor(self.clock.now())


class Tap:
    """What was said on a virtual bus."""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus
        self._heard: list[can.Message] = []

    @property
    def heard(self) -> list[can.Message]:
        while (message := self._bus.recv(0)) is not None:
            self._heard.append(message)
        return self._heard

    def controlwords(self, node: int) -> list[int]:
        """The controlwords sent to a node so far."""
        return [
            int.from_bytes(message.data, "little")
            for message in self.heard
            if message.arbitration_id == 0x200 + node
        ]

    def said(self, can_id: int) -> int:
        """How often something was said under this identifier."""
        return sum(message.arbitration_id == can_id for message in self.heard)


async def read_until_lost(rig: Rig, axis: Cia402Axis) -> None:
    """Read the axis again and again, until that raises."""
    while True:
        await axis.read()
        await rig.clock.sleep(0.01)


async def commanded(rig: Rig, tap: Tap, node: int, controlword: int) -> None:
    """Wait until a controlword was sent to a node."""
    while controlword not in tap.controlwords(node):
        await rig.clock.sleep(0.001)


async def under_way(rig: Rig, axis: Cia402Axis) -> None:
    """Wait until the axis moves."""
    while not (await axis.read()).moving:
        await rig.clock.sleep(0.01)


@asynccontextmanager
async def powered(
    slide: dict[str, Any] | None = None, pan: dict[str, Any] | None = None, **options: Any
) -> AsyncIterator[Rig]:
    """Drives with power, and a controller that is not open yet."""
    rig = Rig(slide or {}, pan or {}, **options)
    await rig.start()
    try:
        yield rig
    finally:
        await rig.controller.close()
        await rig.emulator.close()


@asynccontextmanager
async def opened(
    slide: dict[str, Any] | None = None, pan: dict[str, Any] | None = None, **options: Any
) -> AsyncIterator[Rig]:
    """Drives with an open controller."""
    async with powered(slide, pan, **options) as rig:
        await rig.controller.open()
        yield rig


@asynccontextmanager
async def homed(
    slide: dict[str, Any] | None = None, pan: dict[str, Any] | None = None, **options: Any
) -> AsyncIterator[Rig]:
    """Drives with an open controller, and homed."""
    async with opened(slide, pan, **options) as rig:
        await asyncio.gather(*(axis.home() for axis in rig.controller.axes.values()))
        yield rig
