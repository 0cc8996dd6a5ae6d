"""What CiA 402 drives do on their way, each a trap that a driver can fall into."""

import asyncio

import pytest

from drivers.cia402.statusword import State
from drivers.errors import (
    DeviceFaultError,
    DeviceTimeoutError,
    MotionError,
    MotionStoppedError,
    NotHomedError,
)
from tests.drivers.cia402.rigs import SLIDE, Rig, commanded, homed, opened, under_way


async def halted_on_the_way(rig: Rig, target: float = 18.0) -> float:
    """Send the slide to `target` and stop it on its way; return where it stands."""
    move = asyncio.create_task(rig.slide.move(target))
    await under_way(rig, rig.slide)
    await rig.slide.stop()
    with pytest.raises(MotionStoppedError):
        await move
    return rig.reading("slide")


async def test_a_drive_is_enabled_by_what_its_statusword_says() -> None:
    async with opened() as rig:
        with rig.tap() as tap:
            await rig.slide.jog(1.0)
            words = tap.controlwords(1)
        # While the drive is changing its state it ignores what comes: some are said more than once.
        steps = [word for word, after in zip(words, [*words[1:], None], strict=True) if word != after]
        assert steps[:3] == [0x0006, 0x0007, 0x000F]


async def test_a_drive_that_is_not_enabled_is_not_said_to_move() -> None:
    async with opened() as rig:
        rig.emulator.nodes["slide"].servo.interlock = True
        with pytest.raises(
            DeviceTimeoutError, match=r"axis 'slide'.* stays 'switched on': check its motor supply"
        ):
            await rig.slide.jog(1.0)
        assert rig.reading("slide") == 0.0


async def test_the_set_point_is_shaken_hands_on() -> None:
    async with homed() as rig:
        with rig.tap() as tap:
            await rig.slide.move(5.0)
            heard = tap.heard
            words = [word for word in tap.controlwords(1) if not word & 0x100]
        assert words == [0x003F, 0x002F]  # raised with the target, and dropped when it was acknowledged
        target = next(
            index for index, message in enumerate(heard) if message.data[:4] == bytes([0x23, 0x7A, 0x60, 0])
        )
        raised = next(
            index
            for index, message in enumerate(heard)
            if message.arbitration_id == 0x201 and message.data[0] & 0x10
        )
        assert target < raised


async def test_target_reached_is_not_believed_before_the_handshake() -> None:
    async with homed() as rig:
        servo = rig.emulator.nodes["slide"].servo
        servo.set_point_delay = 0.3  # all that time bit 10 still speaks of the last motion
        await rig.slide.move(5.0)
        assert rig.reading("slide") == pytest.approx(5.0)


async def test_a_drive_that_never_acknowledges_is_named_with_its_option() -> None:
    async with homed() as rig:
        rig.emulator.nodes["slide"].servo.acknowledges = False
        with pytest.raises(
            DeviceTimeoutError, match=r"bit 12\): if it never does, set 'acknowledges = false'"
        ):
            await rig.slide.move(5.0)
        assert not (await rig.slide.read()).moving


async def test_target_reached_is_not_believed_while_the_axis_moves() -> None:
    async with homed() as rig:
        node = rig.emulator.nodes["slide"]
        node.set_data(0x6067, 0, (5000).to_bytes(4, "little"))  # "reached" from 5 mm before it on
        await rig.slide.move(15.0)
        assert rig.reading("slide") == pytest.approx(15.0)


async def test_an_axis_that_does_not_arrive_is_found_out_by_its_position() -> None:
    async with homed() as rig:
        node = rig.emulator.nodes["slide"]
        node.set_data(0x6065, 0, (2**32 - 1).to_bytes(4, "little"))  # the drive minds no following error
        node.servo.stall()
        with pytest.raises(MotionError, match=r"axis 'slide' stands at 5[.0-9]* mm and was sent to 10 mm"):
            await rig.slide.move(10.0)


async def test_a_following_error_is_a_fault_in_words() -> None:
    async with homed() as rig:
        rig.emulator.nodes["slide"].servo.stall()
        with pytest.raises(DeviceFaultError, match=r"axis 'slide': .*following error.* \(0x8611\)"):
            await rig.slide.move(15.0)
        state = await rig.slide.read()
        assert (state.homed, state.moving) == (False, False)
        assert state.fault is not None
        assert "0x8611" in state.fault
        with pytest.raises(DeviceFaultError):
            await rig.slide.move(1.0)


async def test_a_stop_returns_when_the_axis_stands_and_leaves_the_motor_enabled() -> None:
    async with homed() as rig:
        with rig.tap() as tap:
            stands = await halted_on_the_way(rig)
            assert tap.controlwords(1)[-1] == 0x010F  # halt, which is no quick stop
        sample = await rig.controller._drives["slide"].sample()
        assert (sample.velocity, sample.state) == (0, State.ENABLED)
        await rig.clock.sleep(0.2)
        assert rig.reading("slide") == stands < 18.0


async def test_a_halted_motion_is_not_taken_up_again_by_the_next_one() -> None:
    async with homed() as rig:
        stands = await halted_on_the_way(rig)
        farthest = stands
        back = asyncio.create_task(rig.slide.jog(-1.0))
        while not back.done():
            farthest = max(farthest, rig.reading("slide"))
            await asyncio.sleep(0.002)
        await back
        assert farthest == stands
        assert rig.reading("slide") == pytest.approx(stands - 1.0, abs=0.01)


async def test_homing_after_a_halt_goes_straight_home() -> None:
    async with homed() as rig:
        stands = await halted_on_the_way(rig)
        farthest = stands
        homing = asyncio.create_task(rig.slide.home())
        while not homing.done():
            farthest = max(farthest, rig.reading("slide"))
            await asyncio.sleep(0.002)
        await homing
        assert farthest == stands
        assert rig.reading("slide") == pytest.approx(0.0)


async def test_a_drive_that_does_not_halt_is_quick_stopped() -> None:
    async with homed() as rig:
        node = rig.emulator.nodes["slide"]
        node.servo.halts = False
        node.set_data(0x6081, 0, (3000).to_bytes(4, "little"))  # so slow that it would not be over by itself
        with rig.tap() as tap:
            stands = await halted_on_the_way(rig)
            assert [word for word in tap.controlwords(1) if not word & 0x10][-1] == 0x0002
        assert stands < 10.0
        await rig.slide.home()


async def test_homing_twice_goes_home_twice() -> None:
    async with homed() as rig:
        await rig.slide.move(10.0)
        await rig.slide.home()  # bit 12 is still set from the first time
        assert rig.reading("slide") == pytest.approx(0.0)
        assert (await rig.slide.read()).position == pytest.approx(0.0)


async def test_homing_that_fails_is_a_fault_and_leaves_the_axis_unhomed() -> None:
    async with homed() as rig:
        servo = rig.emulator.nodes["slide"].servo
        servo.can_home = False
        for _ in range(2):  # the second time bit 13 is set from the first
            with pytest.raises(DeviceFaultError, match=r"axis 'slide': homing failed \(status bit 13\)"):
                await rig.slide.home()
            with pytest.raises(NotHomedError):
                await rig.slide.move(1.0)
        servo.can_home = True
        await rig.slide.home()


async def test_a_mode_that_the_drive_does_not_have_is_named() -> None:
    async with opened() as rig:
        rig.emulator.nodes["slide"].servo.modes = {0, 1}
        with pytest.raises(DeviceFaultError, match=r"axis 'slide': the drive stays in mode 0 .* mode 6"):
            await rig.slide.home()


async def test_a_drive_at_its_own_limit_says_so() -> None:
    async with homed() as rig:
        node = rig.emulator.nodes["slide"]
        for subindex, limit in (1, -3000), (2, 3000):
            node.set_data(0x607D, subindex, limit.to_bytes(4, "little", signed=True))
        with pytest.raises(DeviceTimeoutError, match=r"refuses the set-point: a limit of its own .*bit 11"):
            await rig.slide.move(10.0)
        assert rig.reading("slide") == pytest.approx(0.0)


async def test_a_drive_that_leaves_its_motion_by_itself_is_not_waited_for() -> None:
    async with homed() as rig:
        move = asyncio.create_task(rig.slide.move(18.0))
        await under_way(rig, rig.slide)
        rig.emulator.disable("slide")
        with pytest.raises(DeviceFaultError, match=r"left its motion by itself and is 'switch-on disabled'"):
            await move


async def test_a_drive_that_is_switched_off_during_the_handshake_is_not_waited_for() -> None:
    async with homed() as rig:
        rig.emulator.nodes["slide"].servo.set_point_delay = 60.0
        with rig.tap() as tap:
            move = asyncio.create_task(rig.slide.move(18.0))
            await commanded(rig, tap, 1, 0x003F)
            rig.emulator.disable("slide")
        with pytest.raises(DeviceFaultError, match=r"left its motion by itself and is 'switch-on disabled'"):
            await move


async def test_a_fault_says_why_and_homing_clears_it() -> None:
    async with homed() as rig:
        rig.emulator.fail("slide", "0x3210")
        state = await rig.slide.read()
        assert state.fault == "the drive is in fault: DC link over-voltage (0x3210)"
        assert state.position is None
        with pytest.raises(DeviceFaultError, match=r"DC link over-voltage.*home the axis"):
            await rig.slide.jog(1.0)
        await rig.slide.home()
        assert (await rig.slide.read()).fault is None
        await rig.slide.move(3.0)


async def test_a_fault_is_reset_by_a_rising_edge_however_often() -> None:
    async with opened() as rig:
        servo = rig.emulator.nodes["slide"].servo
        rig.emulator.fail("slide", "0x2310")
        servo.cause_persists = True
        with pytest.raises(
            DeviceFaultError, match=r"continuous over-current \(0x2310\), and it cannot be reset"
        ):
            await rig.slide.home()
        servo.cause_persists = False
        await rig.slide.home()


async def test_an_absolute_encoder_knows_its_position_from_power_up_on() -> None:
    async with opened(slide={"absolute": True}) as rig:
        state = await rig.slide.read()
        assert (state.homed, state.position) == (True, pytest.approx(0.0))
        await rig.slide.move(5.0)
        await rig.slide.home()
        assert rig.reading("slide") == pytest.approx(5.0)
        rig.emulator.fail("slide", "0x4310")
        state = await rig.slide.read()
        assert (state.homed, state.fault) == (
            True,
            "the drive is in fault: the motor or its output stage is too hot (0x4310)",
        )
        await rig.slide.home()
        await rig.slide.move(0.0)


async def test_an_axis_may_count_the_other_way() -> None:
    async with homed(slide={"counts_per_unit": -500.0}) as rig:
        await rig.slide.move(7.0)
        assert rig.reading("slide") == pytest.approx(7.0)
        assert rig.emulator.nodes["slide"].servo.position == -3500


async def test_the_drive_gets_the_profile_s_velocity_and_acceleration() -> None:
    async with opened() as rig:
        node = rig.emulator.nodes["slide"]
        kept = [int.from_bytes(node.get_data(index, 0), "little") for index in (0x6081, 0x6083, 0x6084)]
        assert kept == [1000 * SLIDE.velocity, 1000 * SLIDE.acceleration, 1000 * SLIDE.acceleration]


async def test_closing_switches_the_motor_off() -> None:
    async with homed(silence="1 s") as rig:
        assert rig.emulator.nodes["slide"].servo.state == "enabled"
        await rig.controller.close()
        await rig.clock.sleep(1.5)  # and the drive does not mind that nobody is there any longer
        assert rig.emulator.nodes["slide"].servo.state == "ready"
