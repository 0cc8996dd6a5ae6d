"""The contract of axes and their controllers (`drivers.axis`) as tests."""
# ruff: noqa: D102 (a test's name is its sentence)

import asyncio
import math
from abc import ABC, abstractmethod

from drivers.axis import Axis, AxisController
from drivers.contract.axis_bench import (
    GLANCE,
    AxisBench,
    expect_at_rest,
    expect_standing_at,
    homed,
    long_move,
    opened,
    span,
    within,
)
from drivers.contract.expectations import expect, refused
from drivers.errors import (
    AxisBusyError,
    DeviceLostError,
    DriverError,
    LimitError,
    MotionStoppedError,
    NotHomedError,
)


class AxisContract(ABC):
    """Subclass this, give it a `bench`, and a driver of axes is tested."""

    @abstractmethod
    def bench(self) -> AxisBench:
        """Return a new controller to be tested; called once a test."""

    async def test_the_axes_are_known_before_opening(self) -> None:
        bench = self.bench()
        before = {name: axis.spec for name, axis in bench.controller.axes.items()}
        expect(bench.axis in before, "the controller lacks the axis that the bench names")
        expect(
            isinstance(bench.controller, AxisController), "the controller lacks a method of AxisController"
        )
        async with opened(bench) as axis:
            expect(isinstance(axis, Axis), "the axis lacks a method of Axis")
            after = {name: axis.spec for name, axis in bench.controller.axes.items()}
        expect(after == before, "opening changed the axes' specifications")

    async def test_a_closed_device_is_lost(self) -> None:
        bench = self.bench()
        with refused(DeviceLostError):
            await bench.controller.axes[bench.axis].read()

    async def test_opening_moves_nothing(self) -> None:
        async with opened(self.bench()) as axis:
            first, second = await axis.read(), await axis.read()
        expect(not first.moving and not second.moving, "the axis moves although nobody asked for it")
        expect(first.position == second.position, "the position changes although nobody moves the axis")

    async def test_an_axis_that_is_not_homed_refuses_positions_but_jogs(self) -> None:
        async with opened(self.bench()) as axis:
            state = await axis.read()
            if state.homed:
                return  # an absolute encoder: there is nothing to refuse
            expect(state.position is None, "the axis reports a position that it cannot know")
            with refused(NotHomedError):
                await axis.move(within(axis, 0.5))
            await axis.jog(span(axis) * 0.01)
            expect(not (await axis.read()).moving, "a jog returned before the axis stood")

    async def test_homing_tells_the_axis_where_it_is(self) -> None:
        async with opened(self.bench()) as axis:
            await axis.home()
            state = await axis.read()
            expect(state.homed and not state.moving, "homing returned before the axis was homed and stood")
            low, high = axis.spec.limits
            position, slack = state.require_homed(axis.spec), axis.spec.tolerance
            expect(low - slack <= position <= high + slack, "after homing the axis is outside its limits")

    async def test_a_move_arrives_and_stands(self) -> None:
        async with homed(self.bench()) as axis:
            for share in (0.3, 0.6, 0.2):
                await axis.move(within(axis, share))
                await expect_standing_at(axis, within(axis, share))

    async def test_a_target_outside_the_limits_moves_nothing(self) -> None:
        async with homed(self.bench()) as axis:
            await axis.move(within(axis, 0.5))
            low, high = axis.spec.limits
            for target in (low - span(axis) * 0.01, high + span(axis) * 0.01, math.nan, math.inf):
                with refused(LimitError):
                    await axis.move(target)
            with refused(LimitError):
                await axis.jog(span(axis))
            await expect_standing_at(axis, within(axis, 0.5))

    async def test_a_jog_moves_by_its_distance(self) -> None:
        async with homed(self.bench()) as axis:
            await axis.move(within(axis, 0.5))
            await axis.jog(span(axis) * 0.1)
            await expect_standing_at(axis, within(axis, 0.6))
            await axis.jog(span(axis) * -0.2)
            await expect_standing_at(axis, within(axis, 0.4))

    async def test_readings_carry_the_time_at_which_they_were_taken(self) -> None:
        bench = self.bench()
        async with opened(bench) as axis:
            before = bench.clock.now()
            stamps = [(await axis.read()).timestamp for _ in range(3)]
            after = bench.clock.now()
        expect(before <= stamps[0] and stamps[-1] <= after, "a reading's time is not that of the rig's clock")
        expect(stamps == sorted(set(stamps)), "the readings' times do not grow")

    async def test_an_axis_in_motion_says_so(self) -> None:
        bench = self.bench()
        async with homed(bench) as axis, long_move(bench, axis) as move:
            first = await axis.read()
            await bench.clock.sleep(5 * GLANCE)
            second = await axis.read()
            expect(first.moving and first.position != second.position, "the axis moves and does not say so")
            await axis.stop()
            await asyncio.gather(move, return_exceptions=True)

    async def test_a_stop_ends_the_move_and_the_axis_stands(self) -> None:
        bench = self.bench()
        async with homed(bench) as axis, long_move(bench, axis) as move:
            await axis.stop()
            await expect_at_rest(bench, axis)
            with refused(MotionStoppedError):
                await move
            await axis.move(within(axis, 0.5))
            await expect_standing_at(axis, within(axis, 0.5))

    async def test_a_stop_of_a_standing_axis_is_no_error(self) -> None:
        async with homed(self.bench()) as axis:
            await axis.stop()
            await axis.move(within(axis, 0.4))
            await expect_standing_at(axis, within(axis, 0.4))

    async def test_a_cancelled_move_leaves_the_axis_standing(self) -> None:
        bench = self.bench()
        async with homed(bench) as axis, long_move(bench, axis) as move:
            move.cancel()
            await asyncio.wait([move])
            expect(move.cancelled(), "the cancellation did not go on after the axis stood")
            await expect_at_rest(bench, axis)

    async def test_a_second_motion_is_refused_and_the_first_goes_on(self) -> None:
        bench = self.bench()
        async with homed(bench) as axis, long_move(bench, axis) as move:
            for second in (axis.move(within(axis, 0.5)), axis.jog(span(axis) * 0.01), axis.home()):
                with refused(AxisBusyError):
                    await second
            expect(not move.done(), "a motion that was refused ended the one under way")
            await move
            await expect_standing_at(axis, within(axis, 0.9))

    async def test_closing_stops_the_axes(self) -> None:
        bench = self.bench()
        async with homed(bench) as axis, long_move(bench, axis) as move:
            await bench.controller.close()
            with refused(DriverError):
                await move
            await bench.controller.open()
            await expect_at_rest(bench, axis)

    async def test_a_closed_controller_opens_again(self) -> None:
        bench = self.bench()
        for _ in range(2):
            async with homed(bench) as axis:
                await axis.move(within(axis, 0.3))
                await expect_standing_at(axis, within(axis, 0.3))

    async def test_a_lost_device_is_reported_by_everything(self) -> None:
        bench = self.bench()
        if bench.unplug is None:
            return
        async with homed(bench) as axis, long_move(bench, axis) as move:
            bench.unplug()
            with refused(DeviceLostError):
                await move
            for call in (axis.read(), axis.move(within(axis, 0.5)), axis.jog(0.0), axis.home(), axis.stop()):
                with refused(DeviceLostError):
                    await call
            with refused(DeviceLostError):
                await bench.controller.open()
