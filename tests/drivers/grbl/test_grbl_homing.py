"""How Grbl homes: all axes at once or one by one, deaf to all else meanwhile, and stopped only by a reset."""

import asyncio

import pytest

from drivers.errors import DeviceFaultError, MotionStoppedError
from tests.drivers.grbl.benches import SLOW_HOMING, homed, moving, opened, until


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
        await table.world.clock.sleep(0.1)
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
        await table.world.clock.sleep(0.1)
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
