"""The rig moves, stands, stops, loses its devices and finds them again."""

import asyncio
from pathlib import Path
from typing import Literal, cast

import pytest

from daemon.errors import StandstillError, StopLatchedError, UnknownAxisError
from daemon.profile import Profile
from daemon.rig import Devices, Rig
from drivers.errors import (
    AxisBusyError,
    DeviceLostError,
    LimitError,
    MotionError,
    MotionStoppedError,
    NotHomedError,
)
from drivers.simulated import SimulatedCamera, SimulatedController
from tests.daemon.motions import home_all, until
from tests.daemon.rigs import small_rig


def controller(devices: Devices, name: str) -> SimulatedController:
    return cast(SimulatedController, devices.controllers[name])


async def test_opening_moves_nothing_and_shows_every_axis_unhomed(rig: Rig) -> None:
    snapshot = rig.snapshot
    assert [axis.spec.name for axis in snapshot.axes] == ["slide", "pan"]
    assert snapshot.readings == (None, None)
    assert not snapshot.moving
    assert not any(axis.homed for axis in snapshot.axes)
    assert snapshot.problems == []


async def test_a_move_ends_where_all_axes_stand_at_their_targets(rig: Rig) -> None:
    await home_all(rig)
    await rig.move({"slide": 30.0, "pan": -5.0})
    snapshot = await rig.fresh_snapshot(rig.clock.now())
    assert snapshot.readings == (30.0, -5.0)
    assert not snapshot.moving


async def test_the_rig_knows_from_which_side_an_axis_came(rig: Rig) -> None:
    await home_all(rig)
    assert rig.snapshot.approached == (0, 0)
    await rig.move({"slide": 30.0, "pan": -5.0})
    assert rig.snapshot.approached == (1, -1)
    await rig.move({"slide": 20.0})
    await rig.move({"slide": 20.0})
    await rig.jog("pan", 1.0)
    assert rig.snapshot.approached == (-1, 1)
    await rig.home("pan")
    assert rig.snapshot.approached == (-1, 0)


async def test_an_unhomed_axis_keeps_all_others_from_moving(rig: Rig) -> None:
    await rig.home("slide")
    with pytest.raises(NotHomedError, match="'pan' is not homed"):
        await rig.move({"slide": 30.0, "pan": 1.0})
    assert rig.axis("slide").position == 0.0


async def test_an_unhomed_axis_jogs_by_no_more_than_its_travel(rig: Rig) -> None:
    await rig.home("pan")
    with pytest.raises(LimitError, match=r"'slide' cannot jog by -100\.1 mm: its whole travel is 100 mm"):
        await rig.jog("slide", -100.1)
    with pytest.raises(LimitError, match="'slide' cannot jog by 1e"):
        await rig.jog("slide", 1e308)
    with pytest.raises(LimitError, match=r"'pan' cannot go to 20\.1 deg"):
        await rig.jog("pan", 20.1)
    assert not rig.snapshot.moving
    await rig.jog("slide", 10.0)


async def test_one_target_beyond_its_limits_keeps_all_axes_from_moving(rig: Rig) -> None:
    await home_all(rig)
    with pytest.raises(LimitError, match="'pan' cannot go to 21 deg"):
        await rig.move({"slide": 30.0, "pan": 21.0})
    snapshot = await rig.fresh_snapshot(rig.clock.now())
    assert snapshot.readings == (0.0, 0.0)


async def test_a_homed_axis_jogs_within_its_limits_only(rig: Rig) -> None:
    await rig.jog("slide", 1.0)  # where it is is not known yet, so that a person has to look
    await rig.home("slide")
    await rig.jog("slide", 2.0)
    assert rig.axis("slide").position == 2.0
    with pytest.raises(LimitError):
        await rig.jog("slide", -3.0)


async def test_an_unknown_axis_is_named(rig: Rig) -> None:
    with pytest.raises(UnknownAxisError, match=r"no axis 'tilt': this rig has slide, pan"):
        await rig.move({"tilt": 1.0})


class TestASlowRig:
    """Motions that are still under way when something happens to them."""

    @pytest.fixture
    def profile(self, tmp_path: Path) -> Profile:
        return small_rig(tmp_path, time_scale=1.0, velocity=20.0)

    @pytest.fixture
    async def moving(self, rig: Rig, devices: Devices) -> "asyncio.Task[None]":
        """The slide on its way from 0 to 100 mm, which takes 5 s of life."""
        for axis in ("slide", "pan"):
            await rig.home(axis)
        task = asyncio.create_task(rig.move({"slide": 100.0}))
        await until(rig, lambda snapshot: (snapshot.axis("slide").position or 0.0) > 1.0)
        return task

    async def test_a_second_motion_is_refused(self, rig: Rig, moving: "asyncio.Task[None]") -> None:
        with pytest.raises(AxisBusyError, match="'slide' is moving"):
            await rig.move({"slide": 1.0})
        await rig.stop_axes(["slide"])
        with pytest.raises(MotionStoppedError):
            await moving

    async def test_being_stopped_leaves_its_side_open(self, rig: Rig) -> None:
        await home_all(rig)
        await rig.move({"slide": 1.0})
        assert rig.snapshot.approached[0] == 1
        motion = asyncio.create_task(rig.move({"slide": 100.0}))
        await until(rig, lambda snapshot: snapshot.axis("slide").moving)
        await rig.stop_axes(["slide"])
        with pytest.raises(MotionStoppedError):
            await motion
        assert rig.snapshot.approached[0] == 0

    async def test_a_stop_ends_it_and_latches(self, rig: Rig, moving: "asyncio.Task[None]") -> None:
        await rig.stop("a test asked for it")
        with pytest.raises(MotionStoppedError):
            await moving
        await self.assert_stands_underway(rig)
        with pytest.raises(StopLatchedError, match="a test asked for it"):
            await rig.move({"slide": 0.0})
        with pytest.raises(StopLatchedError):
            await rig.home("pan")
        with pytest.raises(StopLatchedError):
            await rig.jog("pan", 1.0)
        rig.acknowledge_stop()
        await rig.move({"pan": 1.0})

    @pytest.mark.parametrize("turns", range(6))
    async def test_nothing_begins_once_a_stop_was_asked_for(self, rig: Rig, turns: int) -> None:
        await home_all(rig)
        move = asyncio.create_task(rig.move({"slide": 80.0}))
        for _ in range(turns):
            await asyncio.sleep(0)
        assert rig.world is not None
        shaft = rig.world.shaft("slide")[1]
        before = shaft.motion
        await rig.stop("a test")
        with pytest.raises((MotionStoppedError, StopLatchedError)):
            await move
        assert shaft.motion is before or before.target == 80.0

    async def test_a_stop_outlives_the_task_that_asked_for_it(
        self, rig: Rig, moving: "asyncio.Task[None]"
    ) -> None:
        stopping = asyncio.create_task(rig.stop("a client that went away"))
        await asyncio.sleep(0)
        stopping.cancel()
        with pytest.raises(asyncio.CancelledError):
            await stopping
        await self.assert_stands_underway(rig)
        with pytest.raises(MotionStoppedError):
            await moving

    async def test_cancelling_it_stops_the_axis_first(self, rig: Rig, moving: "asyncio.Task[None]") -> None:
        moving.cancel()
        with pytest.raises(asyncio.CancelledError):
            await moving
        await self.assert_stands_underway(rig)
        assert "cancelled" in (rig.axis("slide").last_error or "")
        await rig.move({"pan": 1.0})  # nothing latched

    async def test_a_failing_axis_stops_the_others(self, rig: Rig, devices: Devices) -> None:
        await rig.home("slide")
        await rig.home("pan")
        controller(devices, "head").inject("stall", "pan")
        with pytest.raises(MotionError, match="'pan'"):
            await rig.move({"slide": 100.0, "pan": 2.0})
        await self.assert_stands_underway(rig)

    async def test_closing_stops_it(self, rig: Rig, devices: Devices, moving: "asyncio.Task[None]") -> None:
        await rig.close()
        with pytest.raises(MotionStoppedError):
            await moving
        assert rig.world is not None
        now = rig.clock.now()
        standing = rig.world.true_displacements(now)
        assert (rig.world.true_displacements(now + 1.0) == standing).all()
        assert standing[0] < 0.1

    async def assert_stands_underway(self, rig: Rig) -> None:
        first = await rig.fresh_snapshot(rig.clock.now())
        second = await rig.fresh_snapshot(rig.clock.now())
        assert not first.moving
        assert not second.moving
        assert first.axis("slide").position == second.axis("slide").position
        assert 0.0 < (first.axis("slide").position or 0.0) < 100.0


@pytest.mark.parametrize(
    "fault", ["lost", "mute"]
)  # a mute one still knows, or believes to know, where it is
async def test_a_lost_device_is_stated_and_its_axes_are_unhomed_when_it_is_back(
    rig: Rig, devices: Devices, fault: Literal["lost", "mute"]
) -> None:
    await home_all(rig)
    controller(devices, "stage").inject(fault)
    snapshot = await until(rig, lambda snapshot: snapshot.axis("slide").lost is not None)
    assert "controller 'stage' is lost" in (snapshot.axis("slide").lost or "")
    assert snapshot.axis("pan").lost is None
    assert len(snapshot.problems) == 1
    with pytest.raises(DeviceLostError):
        await rig.move({"slide": 1.0, "pan": 1.0})
    with pytest.raises(DeviceLostError):
        await rig.fresh_snapshot(rig.clock.now())
    with pytest.raises(StandstillError, match="axis 'slide'"):
        await rig.stop("nobody answers")
    rig.acknowledge_stop()

    controller(devices, "stage").repair()
    snapshot = await until(rig, lambda snapshot: snapshot.axis("slide").lost is None)
    assert not snapshot.axis("slide").homed
    assert snapshot.axis("pan").homed
    assert [device.reconnects for device in snapshot.devices] == [1, 0, 0]
    await rig.home("slide")
    await rig.move({"slide": 1.0, "pan": 1.0})


async def test_a_device_lost_in_motion_ends_the_motion_with_its_sentence(rig: Rig, devices: Devices) -> None:
    await home_all(rig)
    move = asyncio.create_task(rig.move({"slide": 100.0}))
    await until(rig, lambda snapshot: snapshot.axis("slide").moving)
    controller(devices, "stage").inject("lost")
    with pytest.raises((DeviceLostError, MotionStoppedError)):
        await move


async def test_a_rig_opens_without_a_device_and_finds_it_later(profile: Profile, devices: Devices) -> None:
    controller(devices, "head").inject("lost")
    rig = await Rig.open(profile, devices)
    try:
        assert rig.axis("pan").lost is not None
        assert rig.axis("pan").timestamp is None
        assert rig.snapshot.timestamp is None
        assert rig.age(rig.snapshot) is None
        controller(devices, "head").repair()
        await until(rig, lambda snapshot: snapshot.timestamp is not None)
        await rig.home("pan")
    finally:
        await rig.close()


async def test_a_lost_camera_is_stated_and_found_again(rig: Rig, devices: Devices) -> None:
    camera = cast(SimulatedCamera, devices.camera)
    camera.inject("lost")
    with pytest.raises(DeviceLostError):
        await rig.frame()
    await until(rig, lambda snapshot: snapshot.devices[-1].lost is not None)
    with pytest.raises(DeviceLostError, match="camera 'main' is lost"):
        await rig.frame()
    camera.repair()
    await until(rig, lambda snapshot: snapshot.devices[-1].lost is None)
    frame = await rig.frame(after=rig.clock.now())
    assert frame.image.shape == (360, 480)


async def test_axes_that_have_been_read_are_not_read_on_and_on_while_another_is_late(
    rig: Rig, devices: Devices
) -> None:
    cast(SimulatedController, devices.controllers["head"]).inject("mute")
    before = rig.axis("slide").number
    with pytest.raises(DeviceLostError):
        await rig.fresh_snapshot(rig.clock.now())
    assert rig.axis("slide").number - before < 20
