"""The Grbl driver on a USB serial port of the kernel, which is unplugged in mid-move and comes back."""

import asyncio
import os
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Mapping
from dataclasses import replace

import pytest
import serial

from drivers.contract import AxisBench, AxisContract
from drivers.discovery.machine import Machine
from drivers.discovery.serial_ports import serial_ports
from drivers.errors import DeviceLostError, NotHomedError
from tests.drivers.grbl.benches import SPECS, Table, make, moving
from tests.kernel.gadget import Gadget, SerialCable
from tests.kernel.modules import settle

SLOW = {name: replace(spec, velocity=20.0) for name, spec in SPECS.items()}
"""Motions that are not over before anything is noticed."""
SETTINGS = {20: 0, 25: 1200, 24: 300}
"""Slow homing (mm a minute), and no soft limits: with them Grbl refuses half of all jogs before it is homed."""

PHASES: Mapping[str, Callable[[Table], Awaitable[None]]] = {
    "homing": lambda table: table.slide.home(),
    "moving": lambda table: table.slide.move(55.0),
    "jogging": lambda table: table.slide.jog(45.0),
}


class Board:
    """An emulated controller behind a gadget, which has its power from the port."""

    def __init__(self, gadget: Gadget, table: Table) -> None:
        self.gadget = gadget
        self.table = table
        self._cable: SerialCable | None = None

    def plug(self) -> None:
        self.table.emulator.replug()
        self._cable = SerialCable(str(self.table.emulator.port.path))
        self.gadget.plug()

    def unplug(self) -> None:
        self.gadget.unplug()
        if self._cable is not None:
            self._cable.cut()
            self._cable = None
        self.table.emulator.unplug()
        settle()


@pytest.fixture
def gadget() -> Iterator[Gadget]:
    gadget = Gadget()
    gadget.make()
    yield gadget
    gadget.remove()


async def plugged(gadget: Gadget, port: str) -> AsyncIterator[Board]:
    """Give a board that is plugged in, and a controller that is not open yet and looks for it at `port`."""
    table = make(SETTINGS, specs=SLOW, port=port, answer_timeout="4 s", start_timeout="10 s")
    await table.emulator.start()
    board = Board(gadget, table)
    board.plug()
    yield board
    await table.controller.close()
    board.unplug()
    await table.emulator.close()


@pytest.fixture
async def board(gadget: Gadget) -> AsyncIterator[Board]:
    """A board that its profile names by the number of its make."""
    async for board in plugged(gadget, str(gadget.by_id)):
        yield board


@pytest.fixture
async def numbered(gadget: Gadget) -> AsyncIterator[Board]:
    """A board that its profile names as the kernel numbers it."""
    async for board in plugged(gadget, "/dev/ttyACM0"):
        assert gadget.port == "/dev/ttyACM0"
        yield board


class TestOnAGadget(AxisContract):
    @pytest.fixture(autouse=True)
    def wired(self, board: Board) -> None:
        self.board = board

    def bench(self) -> AxisBench:
        return AxisBench(
            self.board.table.controller, "slide", self.board.table.world.clock, self.board.unplug
        )


async def homed(board: Board) -> Table:
    await board.table.controller.open()
    await board.table.slide.home()
    await board.table.slide.move(6.0)
    return board.table


async def unplugged_while(board: Board, motion: Awaitable[None]) -> str:
    """Unplug the board while it moves, and return with which words the motion ended."""
    under_way = asyncio.ensure_future(motion)
    await moving(board.table)
    board.unplug()
    with pytest.raises(DeviceLostError) as error:
        await asyncio.wait_for(under_way, 30)
    with pytest.raises(DeviceLostError):
        await board.table.slide.read()
    return str(error.value)


async def recovered(table: Table, stood: float) -> None:
    """Open the controller, which moves nothing and knows nothing; home it, and move."""
    await table.controller.close()
    await table.controller.open()
    state = await table.slide.read()
    assert (state.homed, state.position, state.moving) == (False, None, False)
    with pytest.raises(NotHomedError):
        await table.slide.move(30.0)
    assert table.shaft() == stood
    await table.slide.home()
    await table.slide.move(30.0)
    assert table.shaft() == pytest.approx(30.0, abs=1e-3)


@pytest.mark.parametrize("phase", PHASES)
async def test_a_board_unplugged_in_a_motion_is_lost_and_comes_back_under_its_name(
    board: Board, phase: str
) -> None:
    table, before = await homed(board), board.gadget.port
    said = await unplugged_while(board, PHASES[phase](table))
    assert f"{board.gadget.by_id} is gone" in said
    assert "plug it in again" in said
    stood = table.shaft()
    assert stood < 54.0
    with pytest.raises(DeviceLostError, match=f"no port {board.gadget.by_id}: plug the controller in"):
        await table.controller.open()
    board.plug()
    assert board.gadget.port == before, "the driver has not let go of the port that is gone"
    assert table.shaft() == stood
    await recovered(table, stood)


async def test_a_board_that_comes_back_under_another_number_is_found_by_its_make(board: Board) -> None:
    table, before = await homed(board), board.gadget.port
    foreign = os.open(before, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:  # a program that looks at every port, and holds the one that is gone
        await unplugged_while(board, table.slide.move(55.0))
        stood = table.shaft()
        board.plug()
        assert board.gadget.port != before
    finally:
        os.close(foreign)
    await recovered(table, stood)


async def test_a_board_named_by_its_number_is_not_found_under_another(numbered: Board) -> None:
    table = await homed(numbered)
    foreign = os.open("/dev/ttyACM0", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        await unplugged_while(numbered, table.slide.move(55.0))
        stood = table.shaft()
        numbered.plug()
    finally:
        os.close(foreign)
    with pytest.raises(DeviceLostError, match=r"no port /dev/ttyACM0: .* its name in /dev/serial/by-id"):
        await table.controller.open()
    numbered.unplug()
    numbered.plug()  # now that nobody holds the number
    await recovered(table, stood)


async def test_another_board_in_its_place_is_not_taken_for_it(board: Board) -> None:
    table = await homed(board)
    own, number = board.gadget.by_id, board.gadget.port
    await unplugged_while(board, table.slide.move(55.0))
    stood = table.shaft()
    board.gadget.rename("B2")
    board.plug()
    assert board.gadget.port == number
    with pytest.raises(DeviceLostError, match=f"no port {own}: plug the controller in"):
        await table.controller.open()
    assert table.shaft() == stood


async def test_a_port_that_another_program_has_is_refused_until_it_lets_it_go(board: Board) -> None:
    table = board.table
    with (
        serial.Serial(board.gadget.port, exclusive=True),
        pytest.raises(DeviceLostError, match=r"another program has the port .* open: close that program"),
    ):
        await table.controller.open()
    await recovered(table, table.shaft())


async def test_the_port_is_found_with_its_names_and_who_holds_it(board: Board) -> None:
    await board.table.controller.open()
    [port] = [port for port in serial_ports(Machine()) if port.path == board.gadget.port]
    assert str(board.gadget.by_id) in port.names
    assert os.getpid() in [holder.pid for holder in port.holders]
