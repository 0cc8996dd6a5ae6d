"""The CiA 402 driver on a CAN interface of the kernel: down, up, deleted and made again, and flooded."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Iterator

import can
import pytest

from drivers.cia402.link import Link
from drivers.cia402.options import Cia402Options
from drivers.contract import AxisBench, AxisContract
from drivers.errors import DeviceLostError
from tests.drivers.cia402.rigs import Rig, under_way
from tests.kernel.cable import Cable
from tests.kernel.modules import load, run

INTERFACE = "vcan0"
SLOW = (2000).to_bytes(4, "little")
"""Micrometres a second, for motions that are not over before anything is noticed."""


def take_down() -> None:
    run("ip", "link", "set", INTERFACE, "down")


def bring_up() -> None:
    run("ip", "link", "set", INTERFACE, "up")


def delete() -> None:
    run("ip", "link", "delete", INTERFACE)


def make() -> None:
    run("ip", "link", "add", "dev", INTERFACE, "type", "vcan")
    bring_up()


@pytest.fixture
def interface() -> Iterator[None]:
    load("vcan")
    make()
    yield
    delete()


@pytest.fixture
async def rig(interface: None) -> AsyncIterator[Rig]:
    """Drives at the other end of the interface, and a controller that is not open yet."""
    rig = Rig({}, {}, silence="4 s", heartbeat="100 ms")
    found = await rig.emulator.start()
    cable = Cable(INTERFACE, str(found["channel"]))
    rig.connect(interface="socketcan", channel=INTERFACE)
    yield rig
    await rig.controller.close()
    await asyncio.to_thread(cable.close)
    await rig.emulator.close()


class TestOnAnInterface(AxisContract):
    @pytest.fixture(autouse=True)
    def wired(self, rig: Rig) -> None:
        self.rig = rig

    def bench(self) -> AxisBench:
        return AxisBench(self.rig.controller, "slide", self.rig.clock, take_down)


@pytest.mark.parametrize(("away", "back"), [(take_down, bring_up), (delete, make)], ids=["down", "deleted"])
async def test_an_interface_that_goes_in_mid_move_comes_back(
    rig: Rig, away: Callable[[], None], back: Callable[[], None]
) -> None:
    await rig.controller.open()
    await rig.slide.home()
    rig.emulator.nodes["slide"].set_data(0x6081, 0, SLOW)
    move = asyncio.create_task(rig.slide.move(18.0))
    await under_way(rig, rig.slide)
    away()
    with pytest.raises(DeviceLostError, match=rf"the CAN bus '{INTERFACE}' \(socketcan\)"):
        await move
    await asyncio.sleep(5)  # the drives stop when they have heard nothing for four seconds
    stands = rig.reading("slide")
    await rig.controller.close()
    with pytest.raises(DeviceLostError):
        await rig.controller.open()
    back()
    await asyncio.sleep(0.5)
    await rig.controller.open()
    assert rig.reading("slide") == stands < 17.0
    assert not (await rig.slide.read()).homed
    await rig.slide.home()
    await rig.slide.move(-2.0)
    assert rig.reading("slide") == pytest.approx(-2.0)


async def test_an_interface_that_goes_while_much_is_sent_leaves_nobody_waiting(interface: None) -> None:
    before = threading.enumerate()
    for _ in range(10):
        link = Link(Cia402Options(channel=INTERFACE), [1])
        await link.open()
        await link.ask(lambda network: network.beat(127, 0.0005))
        await asyncio.sleep(0.05)
        take_down()
        await link.close()
        bring_up()
    assert threading.enumerate() == before


async def test_a_bus_that_others_flood_costs_time_and_nothing_else(rig: Rig) -> None:
    await rig.controller.open()
    await rig.slide.home()
    ended = threading.Event()

    def flood() -> None:
        with can.Bus(interface="socketcan", channel=INTERFACE) as bus:
            while not ended.wait(0.2):
                for number in range(2000):  # more than a socket's queue holds
                    bus.send(
                        can.Message(arbitration_id=0x7A0, data=[number & 0xFF] * 8, is_extended_id=False)
                    )

    flooding = threading.Thread(target=flood)
    flooding.start()
    try:
        for target in (5.0, -5.0):
            await rig.slide.move(target)
            assert rig.reading("slide") == pytest.approx(target)
    finally:
        ended.set()
        await asyncio.to_thread(flooding.join)


async def test_an_interface_that_is_not_there_is_said_so(interface: None) -> None:
    link = Link(Cia402Options(channel="can7"), [1])
    with pytest.raises(
        DeviceLostError, match=r"the CAN bus 'can7' \(socketcan\): .*no interface with this name"
    ):
        await link.open()
