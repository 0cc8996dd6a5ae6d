"""What every axis that is derived from `SupervisedAxis` does, on one that only counts what it is told."""

import asyncio
from typing import Any

import pytest

from drivers.axis import AxisSpec, AxisState
from drivers.errors import (
    AxisBusyError,
    DeviceFaultError,
    DeviceLostError,
    DeviceTimeoutError,
    MotionError,
    MotionStoppedError,
    NotHomedError,
)
from drivers.supervised import SupervisedAxis
from tests.drivers.clocks import VirtualClock

SPEC = AxisSpec("slide", "prismatic", "mm", (0.0, 100.0), 50.0, 500.0, 0.01)


class TalkingAxis(SupervisedAxis):
    """An axis that moves in no time, or not before it is told to."""

    def __init__(self, **options: Any) -> None:
        super().__init__(SPEC, VirtualClock(), **options)
        self.told: list[str] = []
        self.begun = asyncio.Event()
        self.position = 10.0
        self.homed = True
        self.fault: str | None = None
        self.moving = False
        self.deaf = False
        self.gate: asyncio.Event | None = None
        self.slip = 0.0
        self.error: Exception | None = None

    async def read(self) -> AxisState:
        position = self.position if self.homed else None
        return AxisState(position, self._clock.now(), self.moving, self.homed, self.fault)

    async def _begin_homing(self) -> None:
        await self._go("home", 0.0)
        self.homed = True

    async def _begin_move(self, target: float) -> None:
        await self._go(f"move {target:g}", target)

    async def _begin_jog(self, distance: float) -> None:
        await self._go(f"jog {distance:g}", self.position + distance)

    async def _go(self, word: str, target: float) -> None:
        self.told.append(word)
        self.begun.set()
        self.moving = self.gate is not None
        self.position = target + self.slip

    async def _halt(self) -> None:
        self.told.append("halt")
        if not self.deaf:
            self.moving = False

    async def _stands(self) -> bool:
        if self.error is not None:
            raise self.error
        if self.gate is not None and self.gate.is_set():
            self.moving = False
        return not self.moving

    async def _where(self) -> float | None:
        return self.position


def moving_axis(**options: Any) -> TalkingAxis:
    axis = TalkingAxis(**options)
    axis.gate = asyncio.Event()
    return axis


async def begun(axis: TalkingAxis, target: float = 50.0) -> "asyncio.Task[None]":
    task = asyncio.create_task(axis.move(target))
    await axis.begun.wait()
    return task


async def test_a_move_that_is_over_was_sent_once() -> None:
    axis = TalkingAxis()
    await axis.move(50.0)
    await axis.jog(5.0)
    await axis.home()
    assert axis.told == ["move 50", "jog 5", "home"]


async def test_an_axis_that_slipped_is_reported_where_it_stands() -> None:
    axis = TalkingAxis()
    axis.slip = -0.5
    with pytest.raises(MotionError, match=r"axis 'slide' stands at 49\.5 mm and was sent to 50 mm"):
        await axis.move(50.0)
    with pytest.raises(MotionError, match=r"stands at 51 mm and was sent to 51\.5 mm"):
        await axis.jog(2.0)


async def test_an_axis_that_is_not_sound_moves_only_to_be_homed() -> None:
    axis = TalkingAxis()
    axis.homed = False
    with pytest.raises(NotHomedError):
        await axis.move(50.0)
    axis.fault = "the box is in alarm"
    for call in (axis.move(50.0), axis.jog(1.0)):
        with pytest.raises(DeviceFaultError, match=r"axis 'slide': the box is in alarm: clear .* and home"):
            await call
    assert axis.told == []


async def test_an_axis_that_somebody_else_moves_is_busy() -> None:
    axis = TalkingAxis()
    axis.moving = True
    for call in (axis.move(50.0), axis.jog(1.0), axis.home()):
        with pytest.raises(AxisBusyError):
            await call
    assert axis.told == []


async def test_a_motion_without_end_is_stopped_after_its_time() -> None:
    axis = moving_axis()
    with pytest.raises(DeviceTimeoutError, match=r"reports motion 3\.0 s after it was sent to 50 mm"):
        await axis.move(50.0)
    assert axis.told == ["move 50", "halt"]


async def test_a_program_that_was_held_up_asks_once_more_before_it_calls_a_motion_endless() -> None:
    class Held(TalkingAxis):
        """Its answer that it moves is heard a minute later, when it has long come to its end."""

        async def _stands(self) -> bool:
            stood, self.moving = not self.moving, False
            await self._clock.sleep(60.0)
            return stood

    axis = Held()
    axis.gate = asyncio.Event()
    await axis.move(50.0)
    assert axis.told == ["move 50"]


async def test_an_axis_that_does_not_stop_is_said_to_run_on() -> None:
    axis = moving_axis()
    axis.deaf = True
    with pytest.raises(DeviceTimeoutError, match=r"told to stop and still reports motion: switch off"):
        await axis.move(50.0)


@pytest.mark.parametrize("error", [DeviceLostError("it is gone"), DeviceFaultError("it is in alarm")])
async def test_a_device_that_fails_in_a_motion_is_told_to_stop(error: Exception) -> None:
    axis = moving_axis()
    move = await begun(axis)
    axis.error = error
    with pytest.raises(type(error)):
        await move
    assert axis.told == ["move 50", "halt"]


async def test_a_stop_before_the_command_keeps_it_from_being_sent() -> None:
    turn = asyncio.Lock()
    axis = TalkingAxis(turn=turn)
    async with turn:
        move = asyncio.create_task(axis.move(50.0))
        await asyncio.sleep(0)
        await axis.stop()
    with pytest.raises(MotionStoppedError):
        await move
    assert axis.told == ["halt"]


async def test_a_cancelled_motion_is_stopped_before_the_cancellation_goes_on() -> None:
    axis = moving_axis()
    move = await begun(axis)
    move.cancel()
    with pytest.raises(asyncio.CancelledError):
        await move
    assert axis.told == ["move 50", "halt"]
    assert not axis.moving


async def test_axes_that_share_a_turn_move_one_after_the_other() -> None:
    turn = asyncio.Lock()
    first, second = moving_axis(turn=turn), TalkingAxis(turn=turn)
    move = await begun(first)
    other = asyncio.create_task(second.move(20.0))
    with pytest.raises(AxisBusyError):
        await first.move(60.0)
    assert second.told == []
    assert first.gate is not None
    first.gate.set()
    await asyncio.gather(move, other)
    assert second.told == ["move 20"]


async def test_a_cancelled_wait_for_the_turn_sends_nothing() -> None:
    turn = asyncio.Lock()
    first, second = moving_axis(turn=turn), TalkingAxis(turn=turn)
    move = await begun(first)
    other = asyncio.create_task(second.move(20.0))
    await asyncio.sleep(0)
    other.cancel()
    with pytest.raises(asyncio.CancelledError):
        await other
    assert second.told == []
    assert first.gate is not None
    first.gate.set()
    await move
