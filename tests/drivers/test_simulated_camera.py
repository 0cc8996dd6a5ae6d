import asyncio
from typing import Any

import numpy as np
import pytest

from drivers.camera import CameraSpec
from drivers.driver import DriverContext
from drivers.errors import DeviceLostError, DeviceTimeoutError, OptionsError
from drivers.simulated.camera import SimulatedCamera
from drivers.simulated.motion import trapezoid
from drivers.simulated.world import SimulatedWorld
from tests.drivers import rigs
from tests.drivers.clocks import VirtualClock

SMALL = {"lens": {"fx": "700 px", "fy": "700 px", "cx": "320 px", "cy": "240 px"}}


def world(**changes: Any) -> SimulatedWorld:
    return rigs.world(VirtualClock(), **SMALL | changes)


async def opened(world: SimulatedWorld, **options: Any) -> SimulatedCamera:
    camera = rigs.camera(world, 640, 480, **options)
    await camera.open()
    return camera


async def test_frames_begin_on_the_grid_of_the_frame_rate() -> None:
    rig = world(picture={"frame_rate": "10 Hz", "exposure": "20 ms"})
    camera = await opened(rig)
    frame = await camera.frame(after=rig.clock.now() + 0.01)
    assert frame.timestamp == pytest.approx(frame.sequence * 0.1)
    assert frame.exposure == 0.02
    following = await camera.frame(after=frame.timestamp + 0.001)
    assert following.sequence > frame.sequence


async def test_the_first_frame_that_begins_after_is_taken() -> None:
    rig = world(picture={"frame_rate": "2 Hz", "exposure": "10 ms"})
    camera = await opened(rig)
    after = rig.clock.now() + 0.2
    frame = await camera.frame(after=after)
    assert after <= frame.timestamp < after + 0.5


async def test_a_frame_is_taken_once_and_shared() -> None:
    camera = await opened(rig := world(picture={"frame_rate": "1 Hz"}))
    after = rig.clock.now()
    first, second = await asyncio.gather(camera.frame(after), camera.frame(after))
    assert first is second


async def test_noise_is_repeatable_and_differs_from_frame_to_frame() -> None:
    pictures = {}
    for _ in range(2):
        camera = await opened(world())
        frames = [await camera.frame()]
        frames.append(await camera.frame(after=frames[0].timestamp + 1e-9))
        assert not np.array_equal(frames[0].image, frames[1].image)
        for frame in frames:
            same = pictures.setdefault(frame.sequence, frame.image)
            assert np.array_equal(frame.image, same)


async def test_a_moving_camera_blurs_along_its_motion_and_a_standing_one_does_not() -> None:
    rig = world(picture={"exposure": "20 ms", "noise": 0.0, "defocus": "0 px"})
    _, slide = rig.shaft("slide")
    camera = await opened(rig)
    sharp = (await camera.frame()).image.astype(float)
    began = rig.clock.now()
    slide.drive(trapezoid(0.0, -1e5, began, velocity=400.0, acceleration=1e6))
    frame = await camera.frame(after=began + 0.01)
    blurred = frame.image.astype(float)
    # 400 mm/s for 20 ms at 450 mm with f = 700 px: 12 px along the rows, nothing across them.
    edges = [np.abs(np.diff(image, axis=1)).max() for image in (sharp, blurred)]
    assert edges[0] > 100 > 40 > edges[1]
    across = np.abs(np.diff(blurred, axis=0)).max()
    assert across > 100
    # The picture is that of the middle of the exposure.
    middle = rig.world_from_camera_at(frame.timestamp + frame.exposure / 2)
    u, v = rig.project_from(rig.target_points()[24], middle)[0]
    assert 30 < u < 610
    window = 200.0 - blurred[int(v) - 22 : int(v) + 23, int(u) - 22 : int(u) + 23].clip(0, 200)
    columns = np.arange(int(u) - 22, int(u) + 23)
    assert (window.sum(axis=0) * columns).sum() / window.sum() == pytest.approx(u, abs=0.3)


async def test_the_camera_sees_the_swing_that_the_encoder_does_not() -> None:
    swing = {"amplitude": "2 mm", "frequency": "3 Hz", "damping": 0.02}
    rig = world(slide={"settling": swing}, picture={"noise": 0.0})
    _, slide = rig.shaft("slide")
    camera = await opened(rig)
    still = await camera.frame()
    motion = trapezoid(0.0, 10.0, rig.clock.now(), velocity=100.0, acceleration=1000.0)
    back = trapezoid(10.0, 0.0, motion.ends, velocity=100.0, acceleration=1000.0)
    slide.drive(motion)
    slide.drive(back)
    swinging = await camera.frame(after=back.ends)
    assert slide.motor(swinging.timestamp) == 0.0
    assert np.abs(swinging.image.astype(float) - still.image).max() > 20
    calm = await camera.frame(after=back.ends + 30.0)
    assert np.abs(calm.image.astype(float) - still.image).max() <= 1


async def test_rendering_leaves_the_event_loop_free() -> None:
    camera = await opened(world())
    beats = 0

    async def heart() -> None:
        nonlocal beats
        while True:
            beats += 1
            await asyncio.sleep(0)

    beating = asyncio.create_task(heart())
    before = beats
    frame = asyncio.create_task(camera.frame())
    await frame
    assert beats > before + 5
    beating.cancel()
    await asyncio.gather(beating, return_exceptions=True)


async def test_a_lost_camera_can_be_plugged_in_again() -> None:
    rig = world()
    camera = await opened(rig)
    waiting = asyncio.create_task(camera.frame(after=rig.clock.now() + 5))
    await asyncio.sleep(0)
    camera.inject("lost")
    with pytest.raises(DeviceLostError, match=r"camera 'main' has gone"):
        await waiting
    camera.repair()
    with pytest.raises(DeviceLostError, match=r"not open"):
        await camera.frame()
    await camera.open()
    assert (await camera.frame(after=rig.clock.now())).image.shape == (480, 640)


async def test_a_frozen_camera_times_out_rather_than_repeat_an_old_frame() -> None:
    rig = world()
    camera = await opened(rig, timeout="500 ms")
    first = await camera.frame()
    camera.inject("frozen")
    again = await camera.frame()
    assert again.sequence >= first.sequence
    assert (await camera.frame()).sequence == again.sequence
    with pytest.raises(DeviceTimeoutError, match=r"camera 'main' delivered no frame for 0.5 s"):
        await camera.frame(after=rig.clock.now())
    camera.repair()
    assert (await camera.frame(after=rig.clock.now())).sequence > again.sequence


async def test_a_late_camera_stamps_its_frames_truly() -> None:
    rig = world()
    camera = await opened(rig, fault="late", lateness="800 ms")
    after = rig.clock.now()
    frame = await camera.frame(after=after)
    assert after <= frame.timestamp <= rig.clock.now() - 0.8
    later = await opened(rig, fault="late", lateness="5 s", timeout="1 s")
    with pytest.raises(DeviceTimeoutError):
        await later.frame(after=rig.clock.now())


async def test_a_device_that_fails_from_the_start() -> None:
    with pytest.raises(DeviceLostError):
        await opened(world(), fault="lost")
    frozen = await opened(world(), fault="frozen")
    with pytest.raises(DeviceTimeoutError):
        await frozen.frame(after=30.0)


async def test_options_that_do_not_fit_are_refused_with_the_reason() -> None:
    with pytest.raises(OptionsError, match=r"needs a world: add a \[simulation\] table"):
        SimulatedCamera.create(
            CameraSpec("main", 640, 480), SimulatedCamera.Options(), DriverContext(VirtualClock())
        )
    with pytest.raises(OptionsError, match=r"cannot see all of its picture"):
        await opened(world(lens=SMALL["lens"] | {"fx": "200 px", "fy": "200 px", "distortion": [-0.3]}))
    with pytest.raises(ValueError, match=r"longer than the time between frames"):
        world(picture={"exposure": "50 ms", "frame_rate": "30 Hz"})
