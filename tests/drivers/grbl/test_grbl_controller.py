"""What the driver makes of what Grbl does: each line of what was seen of the real firmware, and more."""

import asyncio
import os

import pytest

from drivers.clock import SystemClock
from drivers.driver import Cautious, DriverContext
from drivers.emulators.grbl.machine import Block
from drivers.errors import (
    DeviceFaultError,
    DeviceLostError,
    LimitError,
    MotionStoppedError,
    NotHomedError,
    OptionsError,
)
from drivers.grbl import GrblController
from drivers.grbl.options import GrblAxisOptions, GrblOptions
from drivers.registry import controller_driver
from tests.drivers.grbl.benches import (
    AXES,
    SLIDE,
    SLOW_HOMING,
    SPECS,
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


def test_two_axes_of_one_letter_are_refused() -> None:
    axes = {"slide": AXES["slide"], "pan": GrblAxisOptions(letter="X")}
    with pytest.raises(OptionsError, match=r"two axes at /dev/ttyX have the same letter"):
        GrblController.create(SPECS, GrblOptions(port="/dev/ttyX"), axes, DriverContext(SystemClock()))


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
        await asyncio.sleep(0.1)
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


async def test_a_motor_that_does_not_turn_is_found_by_homing() -> None:
    async with opened() as table:
        table.emulator.stall("slide")
        with pytest.raises(DeviceFaultError, match=r"alarm 9: homing did not find the limit switch"):
            await table.slide.home()
        assert not (await table.slide.read()).homed


async def test_homing_that_is_stopped_leaves_the_axes_unhomed_and_without_alarm() -> None:
    async with homed() as table:
        table.emulator.settings.update(SLOW_HOMING)
        homing = asyncio.create_task(table.slide.home())
        await moving(table)
        await table.slide.stop()
        with pytest.raises(MotionStoppedError, match=r"'slide' was stopped on its way to its home"):
            await homing
        stood = table.shaft()
        state = await table.slide.read()
        assert (state.moving, state.homed, state.fault) == (False, False, None)
        await asyncio.sleep(0.1)
        assert table.shaft() == stood
        await table.slide.home()


async def test_homing_says_that_it_moves_and_knows_no_position() -> None:
    async with homed() as table:
        table.emulator.settings.update(SLOW_HOMING)
        homing = asyncio.create_task(table.slide.home())
        await moving(table)
        for axis in (table.slide, table.pan):  # without single-axis homing all of them are homed
            state = await axis.read()
            assert (state.moving, state.homed, state.position) == (True, False, None)
        await homing


async def test_reading_on_and_on_does_not_take_homing_for_a_loss() -> None:
    """Grbl answers no question until it is homed, not even one that came just before."""
    async with opened({24: 60}, answer_timeout="300 ms") as table:

        async def read_on() -> None:
            while True:
                await table.pan.read()
                await asyncio.sleep(0.001)

        reading = asyncio.create_task(read_on())
        began = asyncio.get_running_loop().time()
        await table.slide.home()
        assert asyncio.get_running_loop().time() - began > 0.3, "it was homed before anybody could miss it"
        assert not reading.done()
        reading.cancel()


async def test_homing_that_is_stopped_before_it_is_sent_does_not_begin() -> None:
    async with opened(report_interval="200 ms") as table:
        before = table.shaft()
        homing = asyncio.create_task(table.slide.home())
        await until(lambda: table.slide._machine.homing is not None)
        await table.slide.stop()
        with pytest.raises(MotionStoppedError):
            await homing
        await asyncio.sleep(0.1)
        assert table.shaft() == before


async def test_all_axes_are_homed_at_once_and_not_once_more_for_the_second() -> None:
    async with opened() as table:
        await asyncio.gather(table.slide.home(), table.pan.home())
        assert ((await table.slide.read()).homed, (await table.pan.read()).homed) == (True, True)
        assert table.slide._machine.homings == 1
        await table.pan.home()
        assert table.slide._machine.homings == 2


async def test_axes_are_homed_one_by_one_where_the_firmware_can() -> None:
    async with opened(single_axis_homing=True) as table:
        before = table.shaft()
        await table.pan.home()
        assert table.shaft() == before
        assert ((await table.slide.read()).homed, (await table.pan.read()).homed) == (False, True)


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


async def test_settings_that_do_not_fit_are_all_told_at_once_and_nothing_moves() -> None:
    async with plugged({1: 25, 100: 200.0}) as table:
        before = table.shaft()
        with pytest.raises(
            DeviceFaultError, match=r"is not set as the profile needs: its motors .*; axis 'slide'"
        ):
            await table.controller.open()
        with pytest.raises(DeviceLostError):
            await table.slide.read()
        assert table.shaft() == before


async def test_soft_limits_that_are_off_are_worth_a_warning() -> None:
    async with opened({20: 0}) as table:
        assert isinstance(table.controller, Cautious)
        assert "soft limits are off ($20=0)" in table.controller.warnings[0]
    async with opened() as table:
        assert table.controller.warnings == []


async def test_an_axis_that_the_controller_has_not_is_named() -> None:
    axes = {"slide": GrblAxisOptions(letter="C", machine_zero="60.5 mm")}
    async with plugged(specs={"slide": SLIDE}, axes=axes) as table:
        with pytest.raises(
            DeviceFaultError, match=r"reports no position of 'slide' \(C\): check their 'letter'"
        ):
            await table.controller.open()


async def test_power_loss_leaves_the_position_unknown_and_the_name_may_change() -> None:
    async with homed() as table:
        move = asyncio.create_task(table.slide.move(55.0))
        await moving(table)
        device, occupied = table.emulator.port.device, None
        table.emulator.unplug()
        with pytest.raises(DeviceLostError, match=r"is gone .*plug it in again"):
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


async def test_a_second_program_is_kept_out() -> None:
    async with opened() as table:
        other = GrblController.create(
            SPECS, GrblOptions(port=str(table.emulator.port.path)), AXES, DriverContext(SystemClock())
        )
        with pytest.raises(
            DeviceLostError, match=r"another program has the port .* open: close that program"
        ):
            await other.open()
        await other.close()


async def test_what_does_not_say_that_it_is_grbl_is_not_moved() -> None:
    async with plugged(start_timeout="300 ms") as table:
        table.emulator.mute()
        with pytest.raises(DeviceLostError, match=r"nothing at .* says that it is Grbl: check .* power"):
            await table.controller.open()
        table.emulator.repair()
        table.emulator.garble()
        with pytest.raises(
            DeviceLostError, match=r"does not speak as Grbl does: check the port and 'baud_rate'"
        ):
            await table.controller.open()
        table.emulator.repair()
        await table.controller.open()


async def test_opening_ends_what_an_earlier_program_has_begun() -> None:
    async with plugged() as table:
        machine = table.emulator.firmware.machine
        table.emulator.firmware.receive(b"$X\n")
        await until(lambda: table.emulator.firmware.state == "Idle")
        await machine.plan(Block((-20.0, 0.0, 0.0), 600.0, jog=False))
        await moving(table)
        await table.controller.open()
        before = table.shaft()
        state = await table.slide.read()
        assert (state.moving, state.homed) == (False, False)
        assert table.shaft() == before


async def test_opening_that_is_cancelled_lets_the_port_go() -> None:
    async with plugged(start_timeout="20 s") as table:
        table.emulator.mute()
        opening = asyncio.create_task(table.controller.open())
        await asyncio.sleep(0.1)
        opening.cancel()
        with pytest.raises(asyncio.CancelledError):
            await opening
        table.emulator.repair()
        await table.controller.open()


async def test_questions_at_the_same_time_share_an_answer_and_keep_their_pace() -> None:
    async with opened(report_interval="50 ms") as table:
        states = await asyncio.gather(*(table.slide.read() for _ in range(5)))
        assert len({state.timestamp for state in states}) == 1
        again = await table.slide.read()
        assert again.timestamp - states[0].timestamp >= 0.05
