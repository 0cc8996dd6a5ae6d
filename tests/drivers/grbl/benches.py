"""A table with a slide and a pan on the emulator: mm and degrees, some tenths of a second from end to end."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

from drivers.axis import AxisSpec
from drivers.driver import DriverContext
from drivers.emulators.grbl import GrblEmulator
from drivers.grbl import GrblController
from drivers.grbl.axis import GrblAxis
from drivers.grbl.options import GrblAxisOptions, GrblOptions
from drivers.simulated.options import SimulationOptions
from drivers.simulated.world import SimulatedWorld
from tests.drivers import rigs
from tests.drivers.clocks import PatientClock

SLIDE = AxisSpec("slide", "prismatic", "mm", (0.0, 60.0), 100.0, 2000.0, 0.01)
PAN = AxisSpec("pan", "revolute", "deg", (-40.0, 40.0), 130.0, 3000.0, 0.01)
SPECS: Mapping[str, AxisSpec] = {"slide": SLIDE, "pan": PAN}
AXES: Mapping[str, GrblAxisOptions] = {
    "slide": GrblAxisOptions(letter="X", machine_zero="60.5 mm", steps=250.0),
    "pan": GrblAxisOptions(letter="Y", machine_zero="40.5 deg", steps=80.0),
}
QUICK: Mapping[int, float] = {24: 60000, 25: 60000, 120: 20000, 121: 20000, 122: 20000}
"""Settings of a table that has found its switches before anybody waits for it."""
SLOW_HOMING: Mapping[int, float] = {24: 600, 25: 6000}
"""Settings of one whose homing can be disturbed."""


@dataclass(frozen=True)
class Table:
    emulator: GrblEmulator
    controller: GrblController
    world: SimulatedWorld

    @property
    def slide(self) -> GrblAxis:
        return self.controller.axes["slide"]

    @property
    def pan(self) -> GrblAxis:
        return self.controller.axes["pan"]

    def shaft(self, axis: str = "slide") -> float:
        """Where the axis truly is, in its reading unit."""
        return self.world.shaft(axis)[1].motor(self.world.clock.now())

    def put(self, axis: str, reading: float) -> None:
        """Step an axis to a place in no time, and have its steps counted."""
        zero = AXES[axis].zero(SPECS[axis])
        self.emulator.motors[axis].go(reading - zero, 1e30, 1e40)


def make(
    changes: Mapping[int, float] | None = None,
    *,
    restarts: bool = False,
    single_axis_homing: bool = False,
    specs: Mapping[str, AxisSpec] = SPECS,
    axes: Mapping[str, GrblAxisOptions] = AXES,
    **options: Any,
) -> Table:
    """Make a table that is not plugged in yet; `changes` are settings of the emulator, which are `QUICK` otherwise."""
    clock = PatientClock()
    simulation = SimulationOptions.model_validate(
        {"camera": rigs.camera_truth(), "joints": rigs.joint_truths()}
    )
    world = SimulatedWorld(simulation, [SLIDE, PAN], rigs.TARGETS["circle_grid"], clock)
    context = DriverContext(clock, world)
    emulator = GrblEmulator(
        SPECS,
        AXES,
        context,
        changes={**QUICK, **(changes or {})},
        restarts=restarts,
        single_axis_homing=single_axis_homing,
    )
    keys = {"answer_timeout": "1 s", "report_interval": "10 ms"} | options
    controller = GrblController.create(
        specs,
        GrblOptions.model_validate({"port": str(emulator.port.path)} | keys),
        axes,
        DriverContext(clock),
    )
    return Table(emulator, controller, world)


@asynccontextmanager
async def plugged(*arguments: Any, **options: Any) -> AsyncIterator[Table]:
    """Give a table that is plugged in, and see that nothing of it is left."""
    before = asyncio.all_tasks()
    table = make(*arguments, **options)
    await table.emulator.start()
    try:
        yield table
    finally:
        await table.controller.close()
        await table.emulator.close()
    await asyncio.sleep(0)
    left = asyncio.all_tasks() - before
    assert not left, left


@asynccontextmanager
async def opened(*arguments: Any, **options: Any) -> AsyncIterator[Table]:
    """Give a table whose controller is open."""
    async with plugged(*arguments, **options) as table:
        await table.controller.open()
        yield table


@asynccontextmanager
async def homed(*arguments: Any, **options: Any) -> AsyncIterator[Table]:
    """Give a table whose axes are homed, and stand at 1/10 of their travel."""
    async with opened(*arguments, **options) as table:
        await table.slide.home()
        table.put("slide", 6.0)
        table.put("pan", -32.0)
        yield table


async def until(holds: Callable[[], bool | Awaitable[bool]]) -> None:
    """Wait until something is so."""
    while True:
        answer = holds()
        if answer if isinstance(answer, bool) else await answer:
            return
        await asyncio.sleep(0.005)


async def moving(table: Table, axis: str = "slide") -> None:
    """Wait until a shaft turns."""
    before = table.shaft(axis)
    await until(lambda: abs(table.shaft(axis) - before) > 0.5)
