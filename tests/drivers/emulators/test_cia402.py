"""The emulated servo drive does what CiA 402 says that drives do, and what real ones were seen to do."""

import asyncio
from collections.abc import AsyncIterator

import can
import pytest

from drivers.clock import SystemClock
from drivers.emulators.cia402.node import Node
from drivers.emulators.cia402.servo import Mechanics
from drivers.emulators.cia402.wire import AdapterWire, BusWire
from drivers.simulated.shaft import Gear, Shaft

SHUT_DOWN, SWITCH_ON, ENABLE, HALT, START, IMMEDIATELY, RESET = 0x06, 0x07, 0x0F, 0x10F, 0x10, 0x20, 0x80
REACHED, BIT_12 = 1 << 10, 1 << 12


class ManualClock(SystemClock):
    def __init__(self) -> None:
        self.time = 100.0

    def now(self) -> float:
        return self.time


class Bench:
    """A drive of 1000 counts to the unit, ten units a second at most, and all that it says."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.shaft = Shaft(Gear(1.0, 0.0, 0.0, 0.0, 0.0, None, None), position=2.0)
        objects = {(0x6065, 0): 500, (0x6081, 0): 10_000, (0x6083, 0): 100_000, (0x6084, 0): 100_000}
        self.node = Node(5, self.shaft, Mechanics(1000.0, 1000.0, 1000.0, 0.0), self.clock, objects)
        self.said: list[tuple[int, bytes]] = []
        self.node.send = lambda can_id, data: self.said.append((can_id, data))

    def after(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.005)):
            self.clock.time += 0.005
            self.node.tick()

    def write(self, index: int, subindex: int, value: int, size: int) -> None:
        self.node.set_data(
            index, subindex, value.to_bytes(size, "little", signed=value < 0), check_writable=True
        )

    def command(self, *words: int) -> None:
        for word in words:
            self.write(0x6040, 0, word, 2)
            self.after(0.03)

    def number(self, index: int, subindex: int = 0) -> int:
        return int.from_bytes(self.node.get_data(index, subindex), "little", signed=True)

    def go(self, counts: int) -> None:
        self.write(0x607A, 0, counts, 4)
        self.command(ENABLE | IMMEDIATELY | START, ENABLE | IMMEDIATELY)

    @property
    def state(self) -> int:
        return self.number(0x6041) & 0x6F


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def enabled(bench: Bench) -> Bench:
    bench.command(SHUT_DOWN, SWITCH_ON, ENABLE)
    bench.write(0x6060, 0, 1, 1)
    return bench


def test_power_comes_step_by_step(bench: Bench) -> None:
    states = [bench.state]
    for word in SHUT_DOWN, SWITCH_ON, ENABLE, SWITCH_ON, SHUT_DOWN, 0:
        bench.command(word)
        states.append(bench.state)
    assert states == [0x40, 0x21, 0x23, 0x27, 0x23, 0x21, 0x40]


def test_a_sequence_that_is_sent_blind_enables_nothing(bench: Bench) -> None:
    for word in SHUT_DOWN, SWITCH_ON, ENABLE:
        bench.write(0x6040, 0, word, 2)
    bench.after(0.1)
    assert bench.state == 0x21


def test_a_set_point_is_acknowledged_until_its_bit_drops(enabled: Bench) -> None:
    enabled.write(0x607A, 0, 3000, 4)
    enabled.command(ENABLE | START)
    assert enabled.number(0x6041) & (BIT_12 | REACHED) == BIT_12
    enabled.command(ENABLE)
    assert not enabled.number(0x6041) & BIT_12
    enabled.after(1.0)
    assert enabled.number(0x6041) & REACHED
    assert (enabled.number(0x6064), enabled.number(0x606C)) == (3000, 0)
    assert enabled.shaft.motor(enabled.clock.now()) == pytest.approx(5.0)  # it counts from where it woke up


def test_a_motion_that_was_halted_goes_on_when_halt_is_taken_away(enabled: Bench) -> None:
    enabled.go(8000)
    enabled.after(0.2)
    enabled.command(HALT)
    enabled.after(0.3)
    stands = enabled.number(0x6064)
    assert 0 < stands < 8000
    assert enabled.number(0x6041) & REACHED
    enabled.command(ENABLE)
    enabled.after(1.0)
    assert enabled.number(0x6064) == 8000


def test_a_new_set_point_replaces_a_halted_one(enabled: Bench) -> None:
    enabled.go(8000)
    enabled.after(0.2)
    enabled.command(HALT)
    enabled.after(0.3)
    enabled.go(-1000)
    enabled.after(2.0)
    assert enabled.number(0x6064) == -1000


def test_a_set_point_that_is_not_immediate_waits_for_its_turn(enabled: Bench) -> None:
    enabled.go(4000)
    enabled.write(0x607A, 0, 0, 4)
    enabled.command(ENABLE | START)
    enabled.after(0.2)
    assert enabled.number(0x606C) > 0
    enabled.after(2.0)
    assert enabled.number(0x6064) == 0


def test_a_quick_stop_ends_in_switch_on_disabled(enabled: Bench) -> None:
    enabled.go(8000)
    enabled.after(0.2)
    enabled.write(0x6040, 0, 0x02, 2)
    assert enabled.state == 0x07
    enabled.after(0.5)
    assert enabled.state == 0x40
    assert 0 < enabled.number(0x6064) < 8000


def test_homing_finds_the_switch(enabled: Bench) -> None:
    enabled.write(0x607C, 0, 250, 4)
    enabled.write(0x6060, 0, 6, 1)
    assert not enabled.number(0x6041) & BIT_12
    enabled.command(ENABLE | START)
    assert not enabled.number(0x6041) & (BIT_12 | REACHED)
    enabled.after(5.0)
    assert enabled.number(0x6041) & (BIT_12 | REACHED) == BIT_12 | REACHED
    assert enabled.number(0x6064) == 250
    assert enabled.shaft.motor(enabled.clock.now()) == 0.0


def test_a_motor_that_is_stuck_ends_in_a_fault_with_an_emergency(enabled: Bench) -> None:
    enabled.node.servo.stall()
    enabled.go(8000)
    enabled.after(1.0)
    assert (enabled.state & 0x4F, enabled.number(0x603F)) == (0x08, 0x8611 - 0x10000)
    assert (0x085, bytes.fromhex("1186210000000000")) in enabled.said


def test_a_fault_is_reset_by_the_edge_of_its_bit(enabled: Bench) -> None:
    servo = enabled.node.servo
    servo.cause_persists = True
    servo.fail(0x2310)
    enabled.command(RESET)
    servo.cause_persists = False
    enabled.command(RESET)
    assert enabled.state & 0x4F == 0x08
    enabled.command(0, RESET)
    assert enabled.state == 0x40
    assert enabled.said[-1] == (0x085, bytes(8))


def test_nothing_moves_that_is_not_enabled(bench: Bench) -> None:
    bench.write(0x6060, 0, 1, 1)
    bench.write(0x607A, 0, 8000, 4)
    bench.command(START, START | SWITCH_ON)
    bench.after(1.0)
    assert bench.number(0x6064) == 0


def test_a_drive_answers_sdos_in_segments_where_they_are_long(bench: Bench) -> None:
    bench.node.receive(0x605, bytes.fromhex("4008100000000000"))
    name = b""
    for command in ("60", "70", "60", "70"):
        if len(name) >= 20:
            break
        bench.node.receive(0x605, bytes.fromhex(command) + bytes(7))
        answer = bench.said[-1][1]
        name += answer[1 : 8 - (answer[0] >> 1 & 7)]
    assert name == b"emulated servo drive"


def test_what_there_is_not_is_refused_by_its_code(bench: Bench) -> None:
    bench.node.receive(0x605, bytes.fromhex("40A8600000000000"))
    assert bench.said[-1] == (0x585, bytes.fromhex("80A8600000000206"))
    bench.node.receive(0x605, bytes.fromhex("2F00100001000000"))
    assert bench.said[-1][1][4:] == bytes.fromhex("02000106")


def test_pdos_come_on_sync_from_an_operational_node_alone(bench: Bench) -> None:
    bench.write(0x1A00, 1, 0x60410010, 4)
    bench.write(0x1A00, 2, 0x60640020, 4)
    bench.write(0x1A00, 0, 2, 1)
    bench.write(0x1800, 2, 1, 1)
    bench.write(0x1800, 1, 0x185, 4)
    bench.node.receive(0x080, b"")
    assert bench.said == []
    bench.node.receive(0, bytes([1, 5]))
    bench.node.receive(0x080, b"")
    assert [(can_id, len(data)) for can_id, data in bench.said] == [(0x185, 6)]


def test_a_reset_boots_and_forgets(enabled: Bench) -> None:
    enabled.go(3000)
    enabled.after(1.0)
    enabled.node.receive(0, bytes([129, 0]))
    assert enabled.said[-1] == (0x705, b"\x00")
    assert (enabled.state, enabled.number(0x6064), enabled.number(0x607A)) == (0x40, 0, 0)


def test_the_heartbeat_tells_the_state(bench: Bench) -> None:
    bench.write(0x1017, 0, 100, 2)
    bench.after(0.25)
    bench.node.receive(0, bytes([1, 5]))
    bench.after(0.25)
    assert [data for can_id, data in bench.said if can_id == 0x705] == [b"\x7f"] * 3 + [b"\x05"] * 2


def test_a_drive_that_hears_no_heartbeat_goes_into_fault(enabled: Bench) -> None:
    enabled.write(0x6007, 0, 1, 2)
    enabled.write(0x1016, 1, 127 << 16 | 200, 4)
    enabled.after(1.0)
    assert enabled.state == 0x27  # none was heard yet
    enabled.node.receive(0x77F, b"\x05")
    enabled.after(0.15)
    enabled.node.receive(0x77F, b"\x05")
    enabled.after(0.15)
    assert enabled.state == 0x27
    enabled.after(0.2)
    assert (enabled.state & 0x4F, enabled.number(0x603F)) == (0x08, 0x8130 - 0x10000)


def test_an_emulator_that_was_held_up_does_not_lay_it_to_others(enabled: Bench) -> None:
    enabled.write(0x6007, 0, 1, 2)
    enabled.write(0x1016, 1, 127 << 16 | 200, 4)
    enabled.node.receive(0x77F, b"\x05")
    enabled.clock.time += 30.0
    enabled.after(0.05)
    enabled.node.receive(0x77F, b"\x05")  # it had been waiting to be heard
    enabled.after(0.15)
    assert enabled.state == 0x27
    enabled.after(0.3)
    assert enabled.state & 0x4F == 0x08


Adapter = tuple[AdapterWire, str, "asyncio.Queue[tuple[int, bytes]]"]


@pytest.fixture
async def adapter() -> AsyncIterator[Adapter]:
    wire, heard = AdapterWire(), asyncio.Queue[tuple[int, bytes]]()
    keys = wire.open(lambda can_id, data: heard.put_nowait((can_id, data)))
    yield wire, str(keys["channel"]), heard
    wire.close()


async def test_an_adapter_carries_frames_both_ways(
    adapter: Adapter,
) -> None:
    wire, port, heard = adapter
    wire.send(0x181, b"lost")  # nobody has opened it
    bus = await asyncio.to_thread(
        can.Bus, interface="slcan", channel=port, bitrate=500000, sleep_after_open=0
    )
    try:
        await asyncio.to_thread(
            bus.send, can.Message(arbitration_id=0x605, data=b"\x40\x00\x10", is_extended_id=False)
        )
        assert await heard.get() == (0x605, b"\x40\x00\x10")
        wire.send(0x585, b"\x01\x02")
        message = await asyncio.to_thread(bus.recv, 10)
        while message is None:
            message = await asyncio.to_thread(bus.recv, 10)
        assert (message.arbitration_id, bytes(message.data)) == (0x585, b"\x01\x02")
    finally:
        await asyncio.to_thread(bus.shutdown)


async def test_an_adapter_that_is_plugged_again_has_its_name_again(
    adapter: Adapter,
) -> None:
    wire, port, _ = adapter
    wire.unplug()
    with pytest.raises(can.CanInitializationError):
        await asyncio.to_thread(can.Bus, interface="slcan", channel=port, sleep_after_open=0)
    wire.plug()
    bus = await asyncio.to_thread(can.Bus, interface="slcan", channel=port, sleep_after_open=0)
    await asyncio.to_thread(bus.shutdown)


async def test_a_bus_says_when_a_controller_goes_off_it() -> None:
    wire = BusWire("virtual", "off-bus")
    wire.open(lambda _id, _data: None)
    with can.Bus(interface="virtual", channel="off-bus") as bus:
        wire.send_bus_off()
        message = bus.recv(10)
    assert message is not None
    assert message.is_error_frame
    assert message.arbitration_id == 0x40
    wire.close()
