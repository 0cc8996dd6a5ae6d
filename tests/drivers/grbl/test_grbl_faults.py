"""Every fault of a serial line in every phase: nothing hangs, nothing moves afterwards, and it is said in words."""

import asyncio
import gc
from collections.abc import Awaitable, Callable, Mapping

import pytest

from drivers.errors import DeviceFaultError, DeviceLostError, DriverError, MotionError, NotHomedError
from tests.drivers.grbl.benches import QUICK, SLOW_HOMING, Table, homed, moving, plugged, until

BOUND = 30.0
"""Seconds in which everything has ended, on a machine that is busy with other things, too."""

Fault = Callable[[Table], None]
FAULTS: Mapping[str, Fault] = {
    "mute": lambda table: table.emulator.mute(),
    "late": lambda table: table.emulator.late(2.0),
    "garbage": lambda table: table.emulator.garble(),
    "reset": lambda table: table.emulator.reset(),
    "alarm 3": lambda table: table.emulator.alarm(3),
    "limit switch": lambda table: table.emulator.limit(),
    "unplugged": lambda table: table.emulator.unplug(),
}
SILENT = {"mute", "late", "garbage", "unplugged"}
"""Those that make it a device that is lost; with the others it answers, and says what is wrong."""


def home_slowly(table: Table) -> Awaitable[None]:
    table.emulator.settings.update(SLOW_HOMING)
    return table.slide.home()


PHASES: Mapping[str, Callable[[Table], Awaitable[None]]] = {
    "homing": home_slowly,
    "moving": lambda table: table.slide.move(55.0),
    "jogging": lambda table: table.slide.jog(45.0),
}


async def at_rest(table: Table) -> float:
    """Expect the shaft to stand, and to stay where it is."""
    async with asyncio.timeout(BOUND):
        while True:
            before = table.shaft()
            await table.world.clock.sleep(0.1)
            if table.shaft() == before:
                break
    await table.world.clock.sleep(0.3)
    assert table.shaft() == before
    return before


async def recovered(table: Table) -> None:
    """Repair the line, connect again, home, and move."""
    async with asyncio.timeout(BOUND):
        table.emulator.repair()
        table.emulator.settings.update(QUICK)
        table.emulator.replug()
        await table.controller.close()
        await table.controller.open()
        state = await table.slide.read()
        assert (state.homed, state.position, state.moving) == (False, None, False)
        await table.slide.home()
        await table.slide.move(50.0)
        assert table.shaft() == pytest.approx(50.0, abs=1e-3)


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("fault", FAULTS)
async def test_a_fault_in_a_motion_ends_it_with_a_sentence(fault: str, phase: str) -> None:
    async with homed(homing_timeout="1500 ms") as table:
        motion = asyncio.ensure_future(PHASES[phase](table))
        await moving(table)
        FAULTS[fault](table)
        expected = DeviceLostError if fault in SILENT else DeviceFaultError
        with pytest.raises(expected) as said:
            async with asyncio.timeout(BOUND):
                await motion
        assert ": " in str(said.value), "it does not say what to do"
        stood = await at_rest(table)
        assert not (0 < abs(stood - 55.0) < 1e-6), "it went on to its target"
        if fault not in SILENT:
            state = await table.slide.read()
            assert (state.homed, state.moving) == (False, False)
        await recovered(table)


@pytest.mark.parametrize("fault", FAULTS)
async def test_a_fault_while_stopping_leaves_the_axis_standing(fault: str) -> None:
    async with homed() as table:
        motion = asyncio.ensure_future(table.slide.move(55.0))
        await moving(table)
        FAULTS[fault](table)
        async with asyncio.timeout(BOUND):
            stop, move = await asyncio.gather(table.slide.stop(), motion, return_exceptions=True)
        assert isinstance(move, DriverError)
        if fault in SILENT:
            assert isinstance(stop, DeviceLostError)
        else:
            assert stop is None
        assert await at_rest(table) < 54.0
        await recovered(table)


@pytest.mark.parametrize("fault", FAULTS)
async def test_a_fault_at_rest_is_told_by_the_next_reading(fault: str) -> None:
    async with homed() as table:
        before = table.shaft()
        FAULTS[fault](table)
        async with asyncio.timeout(BOUND):
            if fault in SILENT:
                with pytest.raises(DeviceLostError):
                    await table.slide.read()
            else:
                await until(lambda: unhomed(table))
        assert table.shaft() == before
        await recovered(table)


async def unhomed(table: Table) -> bool:
    return not (await table.slide.read()).homed


@pytest.mark.parametrize("fault", ["mute", "garbage", "unplugged", "limit switch"])
async def test_a_cancelled_motion_of_a_failing_device_ends_and_stands(fault: str) -> None:
    async with homed() as table:
        motion = asyncio.ensure_future(table.slide.move(55.0))
        await moving(table)
        FAULTS[fault](table)
        motion.cancel()
        async with asyncio.timeout(BOUND):
            await asyncio.wait([motion])
        assert motion.cancelled()
        await at_rest(table)
        await recovered(table)


@pytest.mark.parametrize("fault", ["mute", "late", "garbage", "unplugged"])
async def test_a_fault_while_opening_moves_nothing_and_is_said(fault: str) -> None:
    async with plugged(start_timeout="500 ms") as table:
        before = table.shaft()
        FAULTS[fault](table)
        async with asyncio.timeout(BOUND):
            with pytest.raises(DeviceLostError):
                await table.controller.open()
        assert table.shaft() == before
        await recovered(table)


async def test_bytes_that_are_lost_both_ways_never_make_a_wrong_arrival_a_success() -> None:
    async with homed() as table:
        table.emulator.drop()
        for target in (10.0, 50.0, 20.0, 40.0, 5.0, 55.0):
            try:
                async with asyncio.timeout(BOUND):
                    await table.slide.move(target)
            except DriverError:
                break
            assert table.shaft() == pytest.approx(target, abs=table.slide.spec.tolerance)
        else:
            pytest.fail("no byte was lost")
        await at_rest(table)
        await recovered(table)


async def test_a_motion_that_was_not_answered_is_not_sent_again() -> None:
    async with homed() as table:
        sent = bytearray()
        firmware, hears = table.emulator.firmware, table.emulator.firmware.receive

        def overhear(data: bytes) -> None:
            sent.extend(data)
            if b"$J" in data:
                table.emulator.mute()  # the motion is under way, and its ok is lost
            hears(data)

        firmware.receive = overhear  # type: ignore[method-assign]
        with pytest.raises(DeviceLostError):
            await table.slide.move(55.0)
        stood = await at_rest(table)
        table.emulator.repair()
        await table.controller.open()
        with pytest.raises(NotHomedError):  # where it stands is found out before anything moves
            await table.slide.move(55.0)
        assert await at_rest(table) == stood
        assert sent.count(b"$J") == 1


@pytest.mark.parametrize("question", ["status", "line"])
async def test_a_port_that_takes_nothing_is_an_error_for_whoever_writes_and_for_nobody_else(
    question: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_data: bytes) -> None:
        raise DeviceLostError("the port is gone")

    async with homed() as table:
        left: list[object] = []
        asyncio.get_running_loop().set_exception_handler(lambda _loop, context: left.append(context))
        link = table.slide._machine._link
        monkeypatch.setattr(link._wire._port, "write", fail)
        with pytest.raises(DeviceLostError, match="the port is gone"):
            await (link.status() if question == "status" else link.ask("$I"))
        gc.collect()
        assert left == []  # no error that was never retrieved


async def test_lost_steps_are_found_by_homing_alone() -> None:
    """Grbl counts what it sends: nothing but the camera and the home switch knows better."""
    async with homed() as table:
        table.emulator.slip("slide", 2.0)
        await table.slide.move(30.0)
        assert table.shaft() == pytest.approx(28.0, abs=1e-3)
        await table.slide.home()
        await table.slide.move(30.0)
        assert table.shaft() == pytest.approx(30.0, abs=1e-3)


async def test_a_jog_that_somebody_cancels_is_no_arrival() -> None:
    async with homed() as table:
        motion = asyncio.ensure_future(table.slide.move(55.0))
        await moving(table)
        table.emulator.firmware.receive(b"\x85")
        with pytest.raises(MotionError, match=r"'slide' stands at .* mm and was sent to 55 mm"):
            await motion
