"""What the driver makes of what Grbl does: each line of what was seen of the real firmware, and more."""

import asyncio
import os

import pytest

from drivers.emulators.grbl.machine import Block
from drivers.errors import (
    DeviceFaultError,
    DeviceLostError,
    LimitError,
    MotionStoppedError,
    NotHomedError,
)
from drivers.grbl import GrblController
from drivers.registry import controller_driver
from tests.drivers.grbl.benches import (
    Table,
    homed,
    moving,
    opened,
    plugged,
    until,
)


async def fault(table: Table) -> str | None:
    return (await table.slide.read()).fault


def test_profiles_know_it_as_grbl() -> None:
    assert controller_driver("grbl") is GrblController


async def test_a_move_is_over_when_the_shaft_stands_and_not_at_its_ok() -> None:
    async with homed() as table:
        for target in (20.0, 20.5, 59.0, 58.9, 0.0):
            await table.slide.move(target)
            assert table.shaft() == pytest.approx(target, abs=1e-3)


async def test_a_stop_ends_in_idle_with_its_position_kept() -> None:
    async with homed() as table:
        move = asyncio.create_task(table.slide.move(55.0))
        await moving(table)
        await table.slide.stop()
        with pytest.raises(
            MotionStoppedError, match=r"'slide' was stopped on its way to 55 mm: it stands at"
        ):
            await move
        state = await table.slide.read()
        assert (state.homed, state.fault) == (True, None)
        assert state.position == pytest.approx(table.shaft(), abs=1e-3)
        await table.slide.move(30.0)
        assert table.shaft() == pytest.approx(30.0, abs=1e-3)


@pytest.mark.parametrize("turns", [1, 2, 3, 5, 8, 13, 40])
async def test_a_stop_of_a_jog_that_is_being_taken_in_is_not_lost(turns: int) -> None:
    async with homed() as table:
        move = asyncio.create_task(table.slide.move(55.0))
        for _ in range(turns):
            await asyncio.sleep(0.001)
        await table.slide.stop()
        with pytest.raises(MotionStoppedError):
            await move
        stood = table.shaft()
        await table.world.clock.sleep(0.1)
        assert table.shaft() == stood < 50


async def test_a_restart_in_mid_motion_is_noticed_and_the_position_is_lost() -> None:
    async with homed() as table:
        move = asyncio.create_task(table.slide.move(55.0))
        await moving(table)
        table.emulator.reset()
        with pytest.raises(
            DeviceFaultError, match=r"'slide': the controller has restarted and lost its position"
        ):
            await move
        assert not (await table.pan.read()).homed
        with pytest.raises(NotHomedError):
            await table.slide.move(10.0)
        await table.slide.home()
        await table.slide.move(10.0)
        assert table.shaft() == pytest.approx(10.0, abs=1e-3)


async def test_a_restart_at_rest_is_noticed() -> None:
    async with homed() as table:
        table.emulator.reset()
        await until(lambda: not_homed(table))
        state = await table.slide.read()
        assert (state.position, state.fault) == (None, None)
        await table.slide.jog(-1.0)  # it was locked by its start, and is unlocked


async def not_homed(table: Table) -> bool:
    return not (await table.slide.read()).homed


async def test_a_limit_switch_is_said_in_words_and_its_deafness_ended() -> None:
    async with homed() as table:
        move = asyncio.create_task(table.slide.move(55.0))
        await moving(table)
        table.emulator.limit()
        with pytest.raises(
            DeviceFaultError, match=r"'slide': the controller is in alarm 1: a limit switch tripped"
        ):
            await move
        assert "alarm 1" in str(await fault(table))
        for call in (table.pan.move(0.0), table.slide.jog(1.0)):
            with pytest.raises(DeviceFaultError, match="alarm 1"):
                await call
        await table.slide.home()
        assert await fault(table) is None
        await table.slide.move(10.0)


async def test_a_stale_ok_after_an_alarm_is_no_answer_to_what_comes_next() -> None:
    async with homed() as table:
        table.emulator.alarm(2)
        await until(lambda: in_alarm(table))
        await table.slide.home()
        assert table.shaft() == pytest.approx(60.0, abs=1e-3)  # and not on its way


async def in_alarm(table: Table) -> bool:
    return await fault(table) is not None


@pytest.mark.parametrize("number", [1, 2, 3, 4, 5, 8, 9])
async def test_every_alarm_is_survived_until_homing(number: int) -> None:
    async with homed() as table:
        table.emulator.alarm(number)
        await until(lambda: in_alarm(table))
        assert f"alarm {number}: " in str(await fault(table))
        assert not (await table.slide.read()).homed
        await table.slide.home()
        await table.slide.move(30.0)
        assert table.shaft() == pytest.approx(30.0, abs=1e-3)


async def test_an_alarm_that_was_not_heard_is_seen_in_the_reports() -> None:
    async with homed() as table:
        table.emulator.mute()
        table.emulator.alarm(3)
        table.emulator.repair()
        assert await fault(table) == "the controller is in alarm, for a reason that was not heard"
        assert not (await table.slide.read()).homed


async def test_axes_move_one_after_the_other() -> None:
    async with homed() as table:
        moves = asyncio.gather(table.slide.move(50.0), table.pan.move(30.0))
        await moving(table)
        assert table.shaft("pan") == pytest.approx(-32.0, abs=1e-3)
        assert not (await table.pan.read()).moving
        await moves
        assert (table.shaft(), table.shaft("pan")) == (
            pytest.approx(50, abs=1e-3),
            pytest.approx(30, abs=1e-3),
        )


async def test_a_stop_of_an_axis_that_waits_does_not_end_the_motion_of_the_other() -> None:
    async with homed() as table:
        move = asyncio.create_task(table.slide.move(50.0))
        waiting = asyncio.create_task(table.pan.move(30.0))
        await moving(table)
        await table.pan.stop()
        await move
        with pytest.raises(MotionStoppedError):
            await waiting
        assert (table.shaft(), table.shaft("pan")) == (
            pytest.approx(50, abs=1e-3),
            pytest.approx(-32, abs=1e-3),
        )


async def test_what_others_set_in_motion_is_held_and_keeps_its_position() -> None:
    async with homed() as table:
        machine = table.emulator.firmware.machine
        await machine.plan(Block((-10.0, *machine.position[1:]), 3000.0, jog=False))
        await moving(table)
        assert (await table.slide.read()).moving
        await table.slide.stop()
        state = await table.slide.read()
        assert (state.moving, state.homed, state.fault) == (False, True, None)
        assert state.position == pytest.approx(table.shaft(), abs=1e-3)
        await table.slide.move(20.0)


async def test_a_hold_from_the_panel_is_said_in_words() -> None:
    async with homed() as table:
        table.emulator.firmware.receive(b"!")
        with pytest.raises(DeviceFaultError, match=r"'slide': it is held: release its feed hold"):
            await table.slide.move(20.0)
        table.emulator.firmware.receive(b"~")
        await table.slide.move(20.0)


async def test_soft_limits_of_an_axis_that_is_not_homed_are_explained() -> None:
    async with opened() as table:
        with pytest.raises(LimitError, match=r"'slide' cannot go there: .*error 15.* or home it first"):
            await table.slide.jog(1.0)
        before = table.shaft()
        await table.slide.jog(-1.0)
        assert table.shaft() == pytest.approx(before - 1.0, abs=1e-3)


async def test_positions_in_work_coordinates_are_turned_into_the_machines() -> None:
    async with plugged({10: 0}) as table:
        table.emulator.firmware.offsets = (-7.0, 3.0, 0.0)
        await table.controller.open()
        await table.slide.home()
        await table.slide.move(20.0)
        assert table.shaft() == pytest.approx(20.0, abs=1e-3)
        assert (await table.pan.read()).position == pytest.approx(40.0, abs=1e-3)


async def test_power_loss_leaves_the_position_unknown_and_the_name_may_change() -> None:
    async with homed() as table:
        move = asyncio.create_task(table.slide.move(55.0))
        await moving(table)
        device, occupied = table.emulator.port.device, None
        table.emulator.unplug()
        with pytest.raises(DeviceLostError, match=r"is gone.*: plug it in again"):
            await move
        stood = table.shaft()
        with pytest.raises(DeviceLostError, match=r"there is no port .*by-id"):
            await table.controller.open()
        occupied = os.openpty()
        table.emulator.replug()
        assert table.emulator.port.device != device
        await table.controller.open()
        state = await table.slide.read()
        assert (state.position, state.homed) == (None, False)
        with pytest.raises(NotHomedError):
            await table.slide.move(20.0)
        assert table.shaft() == stood
        await table.slide.home()
        await table.slide.move(20.0)
        for file in occupied:
            os.close(file)


async def test_questions_at_the_same_time_share_an_answer_and_keep_their_pace() -> None:
    async with opened(report_interval="50 ms") as table:
        states = await asyncio.gather(*(table.slide.read() for _ in range(5)))
        assert len({state.timestamp for state in states}) == 1
        again = await table.slide.read()
        assert again.timestamp - states[0].timestamp >= 0.05
