"""Every fault in every phase: none hangs, none is a success, nothing moves afterwards, and all can be well again."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager

import pytest

from drivers.errors import DeviceFaultError, DeviceLostError, DriverError
from tests.drivers.cia402.rigs import Rig, homed, read_until_lost, under_way

SILENCE = 0.8
"""Seconds until a drive, or activecam, counts as lost."""
SLOW = (8000).to_bytes(4, "little")
"""So slow (um/s) that no motion of a test is over before the fault is noticed."""
FAST = (60000).to_bytes(4, "little")

NAMED = r"axis 'slide'|the CAN bus 'test-"
UNREACHABLE = {"mute", "bus off", "unplugged"}
FAULTS: Mapping[str, tuple[Callable[[Rig], None], type[DriverError]]] = {
    "mute": (lambda rig: rig.emulator.mute("slide"), DeviceLostError),
    "late": (lambda rig: rig.emulator.late(str(3 * SILENCE)), DeviceLostError),
    "heartbeat gone": (lambda rig: rig.emulator.stop_heartbeat("slide"), DeviceLostError),
    "failed": (lambda rig: rig.emulator.fail("slide", "0x4310"), DeviceFaultError),
    "disabled": (lambda rig: rig.emulator.disable("slide"), DeviceFaultError),
    "reset": (lambda rig: rig.emulator.reset("slide"), DeviceLostError),
    "without power": (lambda rig: rig.emulator.take_away("slide"), DeviceLostError),
    "bus off": (lambda rig: rig.emulator.go_off(), DeviceLostError),
    "unplugged": (lambda rig: rig.emulator.unplug(), DeviceLostError),
}

PHASES: Mapping[str, Callable[[Rig], Awaitable[None]]] = {
    "homing": lambda rig: rig.slide.home(),
    "moving": lambda rig: rig.slide.move(18.0),
    "jogging": lambda rig: rig.slide.jog(35.0),
}


async def expect_rest_and_recovery(rig: Rig, fault: str) -> None:
    if fault in UNREACHABLE:
        await rig.clock.sleep(1.5 * SILENCE)  # the drive stops when it hears nothing of activecam
    stands = None
    while stands != (stands := rig.reading("slide")):  # some brake for a second
        await rig.clock.sleep(0.1)
    await rig.clock.sleep(0.1)
    assert rig.reading("slide") == stands
    assert stands < 17.0  # nobody went on to the target
    await rig.controller.close()
    rig.emulator.repair()
    await rig.clock.sleep(0.1)
    await rig.controller.open()
    assert rig.reading("slide") == stands  # opening moves nothing
    rig.emulator.nodes["slide"].set_data(0x6099, 1, FAST)
    await rig.slide.home()
    await rig.slide.move(-1.0)
    assert rig.reading("slide") == pytest.approx(-1.0)


@asynccontextmanager
async def at_its_end() -> AsyncIterator[Rig]:
    """A rig whose slide stands near its lower end, and is slow from now on."""
    async with homed(silence=f"{SILENCE} s", heartbeat="50 ms") as rig:
        await rig.slide.move(-18.0)
        node = rig.emulator.nodes["slide"]
        node.set_data(0x6081, 0, SLOW)
        node.set_data(0x6099, 1, SLOW)
        yield rig


async def expect_failure_in_motion(fault: str, phase: str) -> None:
    inject, error = FAULTS[fault]
    async with at_its_end() as rig:
        motion = asyncio.ensure_future(PHASES[phase](rig))
        await under_way(rig, rig.slide)
        inject(rig)
        with pytest.raises(error, match=NAMED):
            await motion
        await expect_rest_and_recovery(rig, fault)


async def expect_failure_while_stopping(fault: str) -> None:
    inject, _ = FAULTS[fault]
    async with at_its_end() as rig:
        rig.emulator.nodes["slide"].set_data(0x6084, 0, SLOW)  # a second to brake
        motion = asyncio.ensure_future(rig.slide.move(18.0))
        await under_way(rig, rig.slide)
        stop = asyncio.create_task(rig.slide.stop())
        await rig.clock.sleep(0.05)
        inject(rig)
        ended, stopped = await asyncio.gather(motion, stop, return_exceptions=True)
        assert isinstance(ended, DriverError)
        assert stopped is None or isinstance(stopped, DriverError)
        await expect_rest_and_recovery(rig, fault)


async def expect_loss_while_idle(fault: str) -> None:
    inject, error = FAULTS[fault]
    async with homed(silence=f"{SILENCE} s", heartbeat="50 ms") as rig:
        inject(rig)
        with pytest.raises(error, match=NAMED):
            await read_until_lost(rig, rig.slide)
        await expect_rest_and_recovery(rig, fault)


async def named(phase: str, expectation: Awaitable[None]) -> None:
    """Say in which phase it was where an expectation is not met."""
    try:
        await expectation
    except BaseException as error:
        error.add_note(f"in the phase '{phase}'")
        raise


@pytest.mark.parametrize("fault", FAULTS)
async def test_a_fault_in_every_phase_each_on_a_bus_of_its_own_side_by_side(fault: str) -> None:
    phases = {phase: expect_failure_in_motion(fault, phase) for phase in PHASES}
    phases["stopping"] = expect_failure_while_stopping(fault)
    if FAULTS[fault][1] is DeviceLostError:
        phases["idle"] = expect_loss_while_idle(fault)
    async with asyncio.TaskGroup() as side_by_side:
        for phase, expectation in phases.items():
            side_by_side.create_task(named(phase, expectation))
