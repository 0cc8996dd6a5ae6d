"""What is looked at before anything moves: that it is Grbl, that nobody else has it, and how it is set."""

import asyncio

import pytest

from drivers.clock import SystemClock
from drivers.driver import Cautious, DriverContext
from drivers.emulators.grbl.machine import Block
from drivers.errors import DeviceFaultError, DeviceLostError, OptionsError
from drivers.grbl import GrblController
from drivers.grbl.options import GrblAxisOptions, GrblOptions
from tests.drivers.grbl.benches import AXES, SLIDE, SPECS, moving, opened, plugged, until


def test_two_axes_of_one_letter_are_refused() -> None:
    axes = {"slide": AXES["slide"], "pan": GrblAxisOptions(letter="X")}
    with pytest.raises(OptionsError, match=r"two axes at /dev/ttyX have the same letter"):
        GrblController.create(SPECS, GrblOptions(port="/dev/ttyX"), axes, DriverContext(SystemClock()))


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
