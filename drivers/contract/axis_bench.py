"""The bench on which an axis is tested: the device, and what is done with it again and again."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass

from drivers.axis import Axis, AxisController
from drivers.clock import Clock
from drivers.contract.expectations import expect

GLANCE = 0.02
"""Seconds between two looks at an axis."""


@dataclass(frozen=True)
class AxisBench:
    """A controller to be tested, not open yet, and one of its axes.

    The axis's limits and velocity should let it cross its range in some seconds of the clock.
    """

    controller: AxisController
    axis: str
    clock: Clock
    unplug: Callable[[], None] | None = None
    """Takes the device away, where that can be done; the loss of a device is not tested without it."""


@asynccontextmanager
async def opened(bench: AxisBench) -> AsyncIterator[Axis]:
    """Open the controller, give its axis, and close it again."""
    await bench.controller.open()
    try:
        yield bench.controller.axes[bench.axis]
    finally:
        await bench.controller.close()


@asynccontextmanager
async def homed(bench: AxisBench) -> AsyncIterator[Axis]:
    """Open the controller, home its axis, and close it again."""
    async with opened(bench) as axis:
        await axis.home()
        yield axis


@asynccontextmanager
async def long_move(bench: AxisBench, axis: Axis) -> AsyncIterator[asyncio.Task[None]]:
    """Give a move from near one end of the range to near the other that is under way."""
    await axis.move(within(axis, 0.1))
    move = asyncio.create_task(axis.move(within(axis, 0.9)))
    try:
        while not (await axis.read()).moving:
            expect(not move.done(), "the move was over before it was seen: give the bench a slower axis")
            await bench.clock.sleep(GLANCE)
        yield move
    finally:
        move.cancel()
        await asyncio.gather(move, return_exceptions=True)


async def expect_standing_at(axis: Axis, target: float) -> None:
    """Expect the axis to stand at `target` within its tolerance."""
    state = await axis.read()
    expect(not state.moving, "the axis was said to have arrived and still moves")
    off = abs(state.require_homed(axis.spec) - target)
    expect(off <= axis.spec.tolerance, f"the axis stands {off:g} {axis.spec.unit} from {target:g}")


async def expect_at_rest(bench: AxisBench, axis: Axis) -> None:
    """Expect the axis to stand still for a while, short of where `long_move` was going."""
    first = await axis.read()
    await bench.clock.sleep(5 * GLANCE)
    second = await axis.read()
    expect(not first.moving and not second.moving, "the axis still moves")
    if first.position is not None and second.position is not None:
        crept = abs(second.position - first.position)
        expect(crept <= axis.spec.tolerance, "the axis says that it stands, and creeps")
        expect(
            abs(second.position - within(axis, 0.9)) > axis.spec.tolerance,
            "the axis ran on to its target although it was stopped",
        )


def span(axis: Axis) -> float:
    """Return the length of the axis's range."""
    low, high = axis.spec.limits
    return high - low


def within(axis: Axis, share: float) -> float:
    """Return the place that lies `share` of the way from the lower limit to the upper one."""
    return axis.spec.limits[0] + share * span(axis)
