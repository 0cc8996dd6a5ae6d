"""What buses, nodes and the CAN libraries do, each a trap that a driver can fall into."""

import asyncio
import errno
import socket
import threading
import time
from typing import Any

import can
import pytest

from drivers.cia402 import objects
from drivers.cia402.controller import Cia402Controller
from drivers.cia402.link import Link, Network
from drivers.cia402.options import Cia402AxisOptions, Cia402Options
from drivers.clock import SystemClock
from drivers.driver import DriverContext
from drivers.errors import DeviceFaultError, DeviceLostError, MotionStoppedError, OptionsError
from tests.drivers.cia402.rigs import SLIDE, commanded, homed, opened, powered, read_until_lost, under_way

SILENCE = 0.8
"""Seconds; short, for tests that wait for it."""


async def test_readings_of_all_axes_are_of_one_instant() -> None:
    async with opened() as rig:
        with rig.tap() as tap:
            slide, pan = await asyncio.gather(rig.slide.read(), rig.pan.read())
            assert slide.timestamp == pan.timestamp
            assert tap.said(0x080) == 1  # one SYNC, which nobody has to send in between
            assert tap.said(0x181) == tap.said(0x182) == 1


async def test_many_tasks_ask_at_once() -> None:
    async with opened() as rig:
        drives = rig.controller._drives.values()
        entries = [objects.DEVICE_TYPE, objects.PROFILE_VELOCITY, objects.STATUSWORD, objects.POSITION]
        answers = await asyncio.gather(
            *(drive.get(entry) for _ in range(50) for drive in drives for entry in entries)
        )
        assert set(answers[::4]) == {0x00020192}
        await asyncio.gather(*(axis.read() for _ in range(50) for axis in rig.controller.axes.values()))


async def test_who_waits_for_a_sample_while_the_bus_is_let_go_is_told_so_and_not_cancelled() -> None:
    async with opened() as rig:
        sampler = rig.controller._sampler
        async with sampler._one_at_a_time:
            asked = asyncio.create_task(sampler.sample(1))
            await asyncio.sleep(0)
            await sampler.close()
            with pytest.raises(DeviceLostError, match=r"the CAN bus .* was closed: open it first"):
                await asked


async def test_lost_frames_cost_time_and_nothing_else() -> None:
    async with homed() as rig:
        rig.emulator.lossy("0.1")
        await rig.slide.move(3.0)
        rig.emulator.lossy("0")
        assert rig.reading("slide") == pytest.approx(3.0)


async def test_a_node_without_a_heartbeat_is_dead_although_it_answers() -> None:
    async with opened(silence=f"{SILENCE} s") as rig:
        rig.emulator.stop_heartbeat("slide")
        began = rig.clock.now()
        with pytest.raises(
            DeviceLostError, match=r"axis 'slide': the drive at node 1 .* no heartbeat for \d"
        ):
            await read_until_lost(rig, rig.slide)
        assert rig.clock.now() - began >= SILENCE / 2
        await rig.pan.read()


async def test_a_node_that_keeps_silent_is_lost_within_its_time() -> None:
    async with opened(silence=f"{SILENCE} s") as rig:
        rig.emulator.mute("slide")
        with pytest.raises(DeviceLostError, match=r"axis 'slide': the drive at node 1"):
            await rig.slide.read()
        with pytest.raises(DeviceLostError):
            await rig.controller._drives["slide"].get(objects.STATUSWORD)


async def test_a_node_that_is_not_there_is_named_when_the_bus_is_opened() -> None:
    async with powered(silence=f"{SILENCE} s") as rig:
        rig.emulator.take_away("pan")
        with pytest.raises(DeviceLostError, match=r"axis 'pan': the drive at node 2 of .* does not answer"):
            await rig.controller.open()
        rig.emulator.repair()
        await rig.controller.open()
        assert rig.emulator.nodes["slide"].servo.state != "fault"  # though it was there all the time


async def test_a_drive_that_was_reset_has_forgotten_where_it_is() -> None:
    async with homed() as rig:
        await rig.slide.move(5.0)
        rig.emulator.reset("slide")
        with pytest.raises(DeviceLostError, match=r"was switched on or reset.*home it again"):
            await rig.slide.read()
        await rig.controller.close()
        await rig.controller.open()
        state = await rig.slide.read()
        assert (state.homed, state.position) == (False, None)
        await rig.slide.home()
        await rig.slide.move(-5.0)
        assert rig.reading("slide") == pytest.approx(-5.0)


async def test_a_boot_up_that_comes_while_the_drive_is_set_up_is_not_missed() -> None:
    async with powered() as rig:
        node = rig.emulator.nodes["slide"]
        hears = node.receive

        def boot_at_once(can_id: int, data: bytes) -> None:
            if can_id == 0:  # the first thing that is said to it
                node.receive = hears  # type: ignore[method-assign]
                node.reset()
            hears(can_id, data)

        node.receive = boot_at_once  # type: ignore[method-assign]
        with pytest.raises(DeviceLostError, match=r"was switched on or reset"):
            await rig.controller.open()
        await rig.controller.open()


async def test_a_node_that_leaves_the_operational_state_is_lost() -> None:
    async with opened() as rig:
        rig.emulator.nodes["slide"].receive(0, bytes([128, 1]))  # by another master's command
        with pytest.raises(DeviceLostError, match=r"has left the operational state"):
            await read_until_lost(rig, rig.slide)


async def test_a_node_that_is_no_servo_drive_is_refused() -> None:
    async with powered() as rig:
        rig.emulator.nodes["slide"]._values[0x1000, 0] = (0x00030191).to_bytes(4, "little")
        with pytest.raises(
            OptionsError, match=r"node 1 .* is no CiA 402 drive: its device type is 0x00030191"
        ):
            await rig.controller.open()


async def test_limits_beyond_the_drive_s_own_are_refused() -> None:
    async with powered() as rig:
        node = rig.emulator.nodes["slide"]
        for subindex, limit in (1, -15000), (2, 20000):
            node.set_data(0x607D, subindex, limit.to_bytes(4, "little", signed=True))
        with pytest.raises(OptionsError, match=r"limits -20 to 20 mm reach beyond .*0x607D\), -15 to 20 mm"):
            await rig.controller.open()
        node.set_data(0x607D, 1, (-20000).to_bytes(4, "little", signed=True))
        await rig.controller.open()


async def test_a_velocity_that_the_drive_does_not_keep_is_refused() -> None:
    async with powered() as rig:
        rig.emulator.nodes["slide"]._values[0x607F, 0] = (50000).to_bytes(4, "little")
        with pytest.raises(OptionsError, match=r"keeps 50000 in its object 0x6081 where 60000 was written"):
            await rig.controller.open()


async def test_a_velocity_too_fine_for_the_drive_s_units_is_refused() -> None:
    async with powered(slide={"velocity_per_unit": 0.02}) as rig:
        with pytest.raises(OptionsError, match=r"its velocity is 1.2 of the drive's units, .* too coarse"):
            await rig.controller.open()


async def test_an_object_that_the_drive_refuses_is_named() -> None:
    async with powered(slide={"homing_method": 17}) as rig:
        rig.emulator.nodes["slide"].object_dictionary[0x6098].access_type = "ro"
        with pytest.raises(DeviceFaultError, match=r"refuses 17 for its object 0x6098: .*read only"):
            await rig.controller.open()


async def test_an_interface_that_is_not_there_is_a_loss_in_words() -> None:
    link = Link(Cia402Options(interface="socketcan", channel="nocan7"), [1])
    with pytest.raises(DeviceLostError, match=r"the CAN bus 'nocan7' \(socketcan\): .*; check its interface"):
        await link.open()
    with pytest.raises(DeviceLostError, match="is not open: open it first"):
        await link.ask(lambda _: None)


async def test_what_is_said_by_multicast_stays_on_the_machine() -> None:
    options = Cia402Options(interface="udp_multicast", channel="239.74.163.2")
    link = Link(options, [1])
    await link.open()
    said_by = socket.socket(fileno=socket.dup(link.require_open().bus.fileno()))
    with said_by:
        assert said_by.getsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL) == 0
    await link.close()


async def test_a_serial_adapter_that_is_not_there_is_a_loss_in_words() -> None:
    link = Link(Cia402Options(interface="slcan", channel="/dev/nothing", bitrate=500000), [1])
    with pytest.raises(DeviceLostError, match=r"the CAN bus '/dev/nothing' \(slcan\)"):
        await link.open()


async def test_an_adapter_that_was_unplugged_is_opened_again_under_another_device() -> None:
    async with homed(interface="slcan", channel="set by the emulator") as rig:
        rig.emulator.unplug()
        with pytest.raises(DeviceLostError, match=r"\(slcan\)"):
            await rig.slide.read()
        with pytest.raises(DeviceLostError):
            await rig.slide.stop()
        await rig.controller.close()
        with pytest.raises(DeviceLostError):
            await rig.controller.open()
        rig.emulator.repair()
        await rig.controller.open()
        await rig.slide.home()
        await rig.slide.move(2.0)
        assert rig.reading("slide") == pytest.approx(2.0)


async def test_bus_off_is_told_from_its_error_frame() -> None:
    async with opened() as rig:
        rig.emulator.go_off()
        with pytest.raises(DeviceLostError, match=r"went off the bus after too many errors"):
            await read_until_lost(rig, rig.slide)
        rig.emulator.repair()
        await rig.controller.close()
        await rig.controller.open()


async def test_drives_stop_by_themselves_when_activecam_is_gone() -> None:
    async with homed(silence=f"{SILENCE} s", heartbeat="50 ms") as rig:
        await rig.slide.move(-18.0)
        rig.emulator.nodes["slide"].set_data(0x6081, 0, (8000).to_bytes(4, "little"))
        move = asyncio.create_task(rig.slide.move(18.0))
        await under_way(rig, rig.slide)
        rig.emulator.unplug()
        with pytest.raises(DeviceLostError):
            await move
        await rig.clock.sleep(1.5 * SILENCE)
        stands = rig.reading("slide")
        assert rig.emulator.nodes["slide"].servo.error_code == 0x8130
        await rig.clock.sleep(0.2)
        assert rig.reading("slide") == stands < 18.0


async def test_a_drive_that_would_not_stop_by_itself_is_warned_of() -> None:
    async with powered() as rig:
        del rig.emulator.nodes["pan"].object_dictionary.indices[0x6007]
        await rig.controller.open()
        (warning,) = rig.controller.warnings
        assert warning.startswith("axis 'pan': the drive at node 2")
        await rig.pan.home()


async def test_a_bus_that_is_opened_again_leaves_no_thread() -> None:
    before = set(threading.enumerate())
    async with opened() as rig:
        for _ in range(2):
            await rig.controller.open()
    assert not set(threading.enumerate()) - before


async def test_a_stop_does_not_wait_behind_questions() -> None:
    async with homed() as rig:
        move = asyncio.create_task(rig.slide.move(18.0))
        await under_way(rig, rig.slide)
        held = threading.Event()
        asked = asyncio.create_task(rig.controller._link.ask(lambda _: held.wait(30)))
        await asyncio.sleep(0.05)
        with rig.tap() as tap:
            halt = asyncio.create_task(rig.slide.stop())
            await commanded(rig, tap, 1, 0x010F)
            assert not asked.done()
        held.set()
        await asyncio.gather(asked, halt)
        with pytest.raises(MotionStoppedError):
            await move


async def test_nothing_is_sent_to_an_axis_after_its_stop() -> None:
    async with homed() as rig:
        node = rig.emulator.nodes["slide"]
        node.servo.set_point_delay = 0.3
        with rig.tap() as tap:
            move = asyncio.create_task(rig.slide.move(18.0))
            await commanded(rig, tap, 1, 0x003F)
            await rig.slide.stop()
            with pytest.raises(MotionStoppedError):
                await move
            await rig.clock.sleep(0.5)
            assert tap.controlwords(1)[-1] == 0x010F
        assert rig.reading("slide") == pytest.approx(0.0)


class FullBus(can.BusABC):
    """A controller whose transmit queue is full for a while."""

    channel_info = "a full bus"

    def __init__(self, code: int, for_times: int) -> None:
        super().__init__(channel="full")
        self.code, self.full = code, for_times
        self.sent: list[can.Message] = []

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.full:
            self.full -= 1
            raise can.CanOperationError("Failed to transmit", self.code)
        self.sent.append(msg)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        time.sleep(0.01)
        return None, False

    def shutdown(self) -> None:
        super().shutdown()


@pytest.mark.parametrize(("code", "times", "sent"), [(errno.ENOBUFS, 3, 1), (errno.ENETDOWN, 1, 0)])
def test_a_full_transmit_queue_is_given_time_to_drain(code: int, times: int, sent: int) -> None:
    network = Network(1.0)
    network.bus = bus = FullBus(code, times)
    if sent:
        network.send_message(0x201, b"\x0f\x00")
    else:
        with pytest.raises(can.CanOperationError, match=str(code)):
            network.send_message(0x201, b"\x0f\x00")
    assert len(bus.sent) == sent
    network.close()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"interface": "socketcan", "bitrate": 500000}, "'bitrate' is for 'slcan'"),
        ({"interface": "slcan", "port": 4000}, "'port' is for 'udp_multicast'"),
        ({"heartbeat": "1 s", "silence": "2 s"}, "'silence' must be at least three times 'heartbeat'"),
    ],
)
def test_options_that_do_not_fit_each_other_are_refused(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        Cia402Options.model_validate({"channel": "can0"} | options)


@pytest.mark.parametrize("nodes", [(3, 3), (3, 127)])
def test_every_axis_needs_a_node_of_its_own(nodes: tuple[int, int]) -> None:
    with pytest.raises(OptionsError, match=r"needs a node of its own"):
        Cia402Controller.create(
            {"a": SLIDE, "b": SLIDE},
            Cia402Options(channel="can0"),
            {name: Cia402AxisOptions(node=node) for name, node in zip("ab", nodes, strict=True)},
            DriverContext(SystemClock()),
        )
