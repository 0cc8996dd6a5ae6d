"""The emulator does what the real firmware was seen to do: a test for each of these things."""

import asyncio
import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from itertools import pairwise
from typing import Any

import pytest

from drivers.emulators.control import describe, obey
from drivers.emulators.emulator import Emulator
from drivers.emulators.grbl.gcode import CodeError, parse
from tests.drivers.emulators.terminals import Terminal, terminal
from tests.drivers.grbl.benches import SLOW_HOMING, Table, make, moving, until

LOCKED = "[MSG:'$H'|'$X' to unlock]"
BANNER = "Grbl 1.1h ['$' for help]"
FAR = "X-50F3000"


@asynccontextmanager
async def locked(*arguments: Any, **options: Any) -> AsyncIterator[tuple[Table, Terminal]]:
    """Give a controller as it is after power-up, and a terminal at its port."""
    table = make(*arguments, **options)
    keys = await table.emulator.start()
    try:
        async with terminal(str(keys["port"])) as port:
            if not options.get("restarts"):
                port.send(b"\x18")
            await port.heard(BANNER, LOCKED)
            yield table, port
    finally:
        await table.emulator.close()


@asynccontextmanager
async def ready(*arguments: Any, **options: Any) -> AsyncIterator[tuple[Table, Terminal]]:
    """Give a controller that is unlocked, at 0."""
    async with locked(*arguments, **options) as (table, port):
        assert await port.answer("$X") == "ok"
        yield table, port


async def test_ok_says_that_a_move_is_planned_and_not_that_it_is_done() -> None:
    async with ready() as (_, port):
        assert await port.answer(f"G1{FAR}") == "ok"
        assert (await port.report()).startswith("<Run|")


async def test_a_report_before_the_ok_may_say_idle_at_the_old_position() -> None:
    async with ready() as (_, port):
        port.forget()
        port.send(f"$J=G90{FAR}\n?")
        await port.heard("<Idle|MPos:0.000", "ok")
        assert (await port.report()).startswith("<Jog|")


async def test_a_dwell_of_nothing_is_answered_when_the_motion_is_over() -> None:
    async with ready() as (_, port):
        await port.answer(f"G1{FAR}")
        assert await port.answer("G4P0") == "ok"
        assert (await port.report()).startswith("<Idle|MPos:-50.000")


async def test_the_buffer_overflows_without_a_word() -> None:
    async with ready() as (_, port):
        port.forget()
        port.send("G1X-10.000F1000\n" * 40)
        await asyncio.sleep(0.3)
        assert await port.answer("") == "ok"
        assert 0 < port.lines.count("ok") < 20
        assert not any(line.startswith("error") for line in port.lines)


async def test_a_carriage_return_and_a_line_feed_are_two_lines() -> None:
    async with ready() as (_, port):
        port.forget()
        port.send(b"G4P0\r\n")
        await port.heard("ok", "ok")


async def test_the_planner_holds_15_blocks_and_then_keeps_its_ok() -> None:
    async with ready() as (_, port):
        port.forget()
        for count in range(16):
            assert await port.answer(f"G1X-{1 + count % 2}F60") == "ok"
        port.forget()
        port.send("G1X-3F60\n")
        await asyncio.sleep(0.2)
        assert port.lines == []
        assert (await port.report()).startswith("<Run|")


async def test_what_comes_while_a_setting_is_written_is_lost() -> None:
    async with ready() as (table, port):
        port.forget()
        port.send("$130=70\n")
        while not table.emulator.firmware._writing:  # noqa: ASYNC110  it tells nobody
            await asyncio.sleep(0)
        table.emulator.firmware.receive(b"?")
        await port.heard("ok")
        assert port.lines == ["ok"]
        await port.answer("$$")
        assert "$130=70.000" in port.lines


async def test_a_hold_slows_down_first_and_goes_on_only_from_a_stand() -> None:
    async with ready({120: 100}) as (table, port):
        await port.answer("G1X-60F6000")
        await table.world.clock.sleep(0.3)
        port.send(b"!")
        assert (await port.report()).startswith("<Hold:1|")
        port.send(b"~")
        stood = await port.state("Hold:0")
        port.forget()
        port.send("G4P0\n")
        await asyncio.sleep(0.1)
        assert port.lines == []
        assert (await port.report()).split("|")[:2] == stood.split("|")[:2]
        port.forget()
        port.send(b"~")
        assert await port.ending() == "ok"
        assert (await port.report()).startswith("<Idle|MPos:-60.000")


async def test_a_reset_from_a_hold_keeps_the_position_without_an_alarm() -> None:
    async with ready() as (table, port):
        await port.answer(f"G1{FAR}")
        await moving(table)
        port.send(b"!")
        held = (await port.state("Hold:0")).split("|")[1]
        port.forget()
        port.send(b"\x18")
        await port.heard(BANNER)
        assert port.lines == [BANNER]
        assert (await port.report()).startswith(f"<Idle|{held}")


async def test_a_reset_in_motion_is_alarm_3() -> None:
    async with ready() as (table, port):
        await port.answer(f"G1{FAR}")
        await moving(table)
        port.forget()
        port.send(b"\x18")
        await port.heard("ALARM:3", BANNER, LOCKED)
        assert "ok" not in port.lines
        assert (await port.report()).startswith("<Alarm|")


@pytest.mark.parametrize("byte", [b"!", b"\x85"])
async def test_a_jog_that_is_held_or_cancelled_slows_down_and_is_forgotten(byte: bytes) -> None:
    async with ready() as (table, port):
        await port.answer(f"$J=G90{FAR}")
        await port.answer("$J=G90X0F3000")
        await moving(table)
        port.send(byte)
        await port.state("Idle")
        before = table.shaft()
        await asyncio.sleep(0.1)
        assert table.shaft() == before
        assert -50 < table.emulator.motors["slide"].position < 0


async def test_a_jog_out_of_the_travel_is_only_refused() -> None:
    async with ready() as (_, port):
        assert await port.answer("$J=G91X1F100") == "error:15"
        assert (await port.report()).startswith("<Idle|")


async def test_a_move_out_of_the_travel_is_alarm_2_and_deafness_until_a_reset() -> None:
    async with ready() as (_, port):
        port.forget()
        port.send("G1X1F100\n")
        await port.heard("ALARM:2", "[MSG:Reset to continue]")
        port.forget()
        port.send("?$X\n")
        await asyncio.sleep(0.1)
        assert port.lines == []
        port.send(b"\x18")
        await port.heard("ok", BANNER, LOCKED)  # the ok is stale
        assert port.lines[0] == "ok"


async def test_a_limit_switch_is_alarm_1_and_deafness_until_a_reset() -> None:
    async with ready() as (table, port):
        await port.answer(f"$J=G90{FAR}")
        await moving(table)
        port.forget()
        table.emulator.limit()
        await port.heard("ALARM:1")
        before = table.shaft()
        port.forget()
        port.send("?")
        await asyncio.sleep(0.1)
        assert (port.lines, table.shaft()) == ([], before)
        port.send(b"\x18")
        await port.heard(BANNER, LOCKED)
        assert "ok" not in port.lines


async def test_a_reset_while_homing_is_alarm_6_and_a_stale_ok() -> None:
    async with locked(SLOW_HOMING) as (table, port):
        port.forget()
        port.send("$H\n")
        await moving(table)
        port.send(b"\x18")
        await port.heard("ALARM:6", "ok", BANNER, LOCKED)


async def test_a_switch_that_is_not_found_is_alarm_9_a_stale_ok_and_a_restart() -> None:
    async with locked() as (table, port):
        table.emulator.stall("slide")
        port.forget()
        port.send("$H\n")
        await port.heard("ALARM:9", "ok", BANNER, LOCKED)


async def test_opening_the_port_restarts_an_arduino_and_its_position_is_0() -> None:
    async with ready(restarts=True) as (table, port):
        await port.answer(f"G1{FAR}")
        await port.answer("G4P0")
        stood = table.shaft()
        async with terminal(str(table.emulator.port.path)):
            pass  # a second program does not restart it: only the first one that opens the port does
        assert (await port.report()).startswith("<Idle|MPos:-50.000")
        port.hang_up()
        await until(lambda: not table.emulator.port._listening)
        async with terminal(str(table.emulator.port.path)) as again:
            await again.heard(BANNER, LOCKED)
            assert (await again.report()).startswith("<Alarm|MPos:0.000,0.000,0.000|")
            assert again.lines[-1].startswith("<Alarm")
            assert table.shaft() == stood


async def test_it_is_locked_after_power_up_until_it_is_homed_or_unlocked() -> None:
    async with locked() as (_, port):
        assert await port.answer("G1X-1F100") == "error:9"
        assert await port.answer("$J=G91X-1F100") == "error:8"
        assert await port.answer("$H") == "ok"
        assert await port.answer("$J=G91X-1F100") == "ok"
        assert await port.answer("G4P0") in {"ok", "error:9"}


async def test_settings_are_not_listed_in_motion() -> None:
    async with ready() as (_, port):
        await port.answer(f"$J=G90{FAR}")
        assert await port.answer("$$") == "error:8"
        assert await port.answer("G1X0F100") == "error:9"


async def test_homing_answers_nothing_before_it_is_done() -> None:
    async with locked(SLOW_HOMING) as (table, port):
        port.forget()
        port.send("$H\n")
        await moving(table)
        port.send("?")
        await port.heard("ok")
        assert [line[:5] for line in port.lines] == ["<Idle", "ok"]
        assert (await port.report()).startswith("<Idle|MPos:-0.500,-0.500")
        assert table.shaft() == pytest.approx(60.0)
        assert table.shaft("pan") == pytest.approx(40.0)


async def test_axes_are_homed_one_by_one_only_where_that_was_built_in() -> None:
    async with locked() as (_, port):
        assert await port.answer("$HX") == "error:3"
    async with locked(single_axis_homing=True) as (table, port):
        assert await port.answer("$HX") == "ok"
        assert (table.shaft(), table.shaft("pan")) == (pytest.approx(60.0), 0.0)


async def test_the_offset_comes_in_every_10th_report_at_rest_and_every_30th_in_motion() -> None:
    async with ready({10: 0}) as (table, port):
        table.emulator.firmware.offsets = (1.0, 2.0, 3.0)
        reports = [await port.report() for _ in range(21)]
        with_offset = [index for index, report in enumerate(reports) if "|WCO:" in report]
        assert with_offset == [0, 10, 20]
        assert all("|WPos:-1.000,-2.000,-3.000|" in report for report in reports)
        assert "WCO:1.000,2.000,3.000" in reports[10]
        await port.answer("$J=G53G90X-50F300")
        reports = [await port.report() for _ in range(70)]
        with_offset = [index for index, report in enumerate(reports) if "|WCO:" in report]
        assert [later - one for one, later in pairwise(with_offset)] == [30, 30]


async def test_it_comes_back_under_another_name_and_knows_nothing() -> None:
    async with ready() as (table, port):
        await port.answer(f"G1{FAR}")
        path, before, occupied = table.emulator.port.path, table.emulator.port.device, os.openpty()
        table.emulator.unplug()
        with pytest.raises(OSError, match="Input/output"):
            port.send("?")
        assert not path.exists()
        assert table.emulator.port.device is None
        stood = table.shaft()
        table.emulator.replug()
        assert before != table.emulator.port.device == os.path.realpath(path)  # noqa: ASYNC240
        async with terminal(str(path)) as again:
            again.send(b"\x18")
            await again.heard(BANNER, LOCKED)
            assert (await again.report()).startswith("<Alarm|MPos:0.000,0.000,0.000|")
            assert table.shaft() == stood
        for file in occupied:
            os.close(file)


async def test_every_fault_can_be_had_by_name() -> None:
    async with ready() as (table, port):
        assert isinstance(table.emulator, Emulator)
        emulators = {"table": table.emulator}
        assert len(describe(emulators).splitlines()) == len(table.emulator.faults)
        assert "slip AXIS DISTANCE" in describe(emulators)
        assert obey(emulators, "table slip sofa 1").endswith("no axis 'sofa': axes are slide, pan")
        before = table.shaft()
        assert obey(emulators, "table slip slide 3").endswith("steps are lost, and nobody notices")
        motor = table.emulator.motors["slide"]
        motor.go(10.0, 1e6, 1e9)  # steps are lost on a motion
        await asyncio.sleep(0.05)
        assert table.shaft() == pytest.approx(before + 10 - 3)
        assert motor.position == 10
        motor.count_from(0.0)
        obey(emulators, "table mute")
        port.forget()
        port.send("?")
        await asyncio.sleep(0.1)
        assert port.received == b""
        obey(emulators, "table repair")
        obey(emulators, "table garbage")
        port.send("?")
        await asyncio.sleep(0.1)
        assert b"<" not in port.received[:1]
        assert port.lines == []


@pytest.mark.parametrize(
    ("text", "number"), [("X", 2), ("1X", 1), ("G17.5X1", 20), ("Q1", 20), ("G1X-1F*", 2)]
)
def test_code_that_is_wrong_is_refused_by_its_number(text: str, number: int) -> None:
    with pytest.raises(CodeError) as refused:
        parse(text, "XYZ")
    assert refused.value.number == number


def test_inches_are_inches() -> None:
    assert parse("g20 x1 f2", "XYZ").axes == {"X": 25.4}
    assert parse("X1", "XYZ", inches=True).axes == {"X": 25.4}
    assert parse("G21X1", "XYZ", inches=True).axes == {"X": 1.0}
