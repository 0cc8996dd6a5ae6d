"""The V4L2 driver against the kernel's test camera and a loopback device."""

import asyncio
import contextlib
import os
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from calib.detection import detect
from calib.targets import CircleGrid
from drivers.camera import CameraSpec, Image
from drivers.clock import SystemClock
from drivers.contract import CameraBench, CameraContract
from drivers.discovery.cameras import cameras
from drivers.discovery.machine import Machine
from drivers.driver import DriverContext
from drivers.errors import DeviceLostError, OptionsError
from drivers.simulated.exposure import Exposure
from drivers.video.camera import VideoCamera
from drivers.video.options import V4l2Options
from drivers.video.source import Capture
from drivers.video.v4l2 import V4l2Camera, V4l2Source
from tests.drivers import rigs
from tests.kernel.loopback import Pusher
from tests.kernel.modules import load, run, unload

SPEC = CameraSpec("eye", 640, 360)


def v4l2(device: str, spec: CameraSpec = SPEC, **options: Any) -> V4l2Camera:
    whole = V4l2Options.model_validate({"device": device, "timeout": "4 s", **options})
    return V4l2Camera.create(spec, whole, DriverContext(SystemClock()))


@asynccontextmanager
async def opened(camera: VideoCamera) -> AsyncIterator[VideoCamera]:
    await camera.open()
    try:
        yield camera
    finally:
        await camera.close()


async def refused(camera: VideoCamera) -> str:
    """Open a camera in vain, and return why."""
    with pytest.raises((DeviceLostError, OptionsError)) as error:
        async with opened(camera):
            pass
    return str(error.value)


async def lost(camera: VideoCamera) -> str:
    """Wait for frames until the camera is lost, and return with which words."""
    with pytest.raises(DeviceLostError) as error:
        await asyncio.wait_for(camera.frame(after=time.monotonic() + 1e6), 60)
    return str(error.value)


def node(device: str) -> str:
    """Return where a name leads to."""
    return str(Path(device).resolve())


def inject(device: str, control: str) -> None:
    run("v4l2-ctl", "-d", device, "-c", control)


class TestVivid(CameraContract):
    @pytest.fixture(autouse=True)
    def plugged_in(self, vivid: str) -> None:
        self.device = vivid

    def bench(self) -> CameraBench:
        return CameraBench(v4l2(self.device), SystemClock())


async def test_what_was_set_is_what_the_camera_does(vivid: str) -> None:
    camera = v4l2(vivid, pixel_format="YUYV", buffers=2, controls={"gain": 77, "contrast": 40})
    async with opened(camera):
        shown = run("v4l2-ctl", "-d", vivid, "--list-ctrls")
        values = {line.split()[0]: line for line in shown.splitlines() if line.strip()}
        assert "value=77" in values["gain"]
        assert "value=40" in values["contrast"]
        assert "value=0" in values["gain_automatic"]
        assert "'YUYV'" in run("v4l2-ctl", "-d", vivid, "--get-fmt-video")
        # The test camera has no exposure to set or to tell, and nothing else to complain of.
        assert ["does not tell its exposure" in warning for warning in camera.warnings] == [True]


async def test_what_the_camera_does_not_do_is_told_of(vivid: str) -> None:
    assert "and was asked for 999 x 333" in await refused(v4l2(vivid, CameraSpec("eye", 999, 333)))
    focus, brightness = {"focus_absolute": 1}, {"brightness": 999}
    assert "has no control 'focus_absolute': it has brightness" in await refused(v4l2(vivid, controls=focus))
    words = await refused(v4l2(vivid, controls=brightness))
    assert "cannot have brightness at 999: its range is 0 to 255" in words
    async with opened(v4l2(vivid, frame_rate="7 Hz", pixel_format="MJPG")) as camera:
        told = " ".join(camera.warnings)
    assert "was asked for MJPG" in told
    assert "frames a second and was asked for 7" in told


async def test_the_camera_is_found_with_its_formats(vivid: str) -> None:
    [camera] = cameras(Machine())
    assert (camera.node.path, camera.node.driver) == (node(vivid), "vivid")
    assert vivid in camera.node.names
    sizes = {form.name: form.sizes for form in camera.formats}
    assert (SPEC.width, SPEC.height) in sizes["YUYV"]
    async with opened(v4l2(vivid)):
        [camera] = cameras(Machine())
        assert os.getpid() in [holder.pid for holder in camera.node.holders]


async def test_a_node_without_pictures_is_told_of(vivid: str) -> None:
    assert "index1 delivers no pictures" in await refused(v4l2(vivid.replace("index0", "index1")))


class Drowsy:
    """A capture whose reader falls asleep when it is told to, and that remembers how old frames were."""

    def __init__(self, device: str) -> None:
        self._capture = cv2.VideoCapture(device, cv2.CAP_V4L2)
        self.sleep = 0.0
        self.ages: list[float] = []

    def read(self) -> tuple[bool, Image | None]:
        seconds, self.sleep = self.sleep, 0.0
        time.sleep(seconds)
        read, image = self._capture.read()
        self.ages.append(time.monotonic() - self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000)
        return read, image

    def __getattr__(self, name: str) -> Any:
        return getattr(self._capture, name)


def drowsy(device: str) -> tuple[VideoCamera, list[Drowsy]]:
    captures: list[Drowsy] = []

    def open_capture(path: str) -> Capture:
        captures.append(Drowsy(path))
        return captures[-1]

    options = V4l2Options.model_validate({"device": device, "timeout": "4 s"})
    source = V4l2Source(SPEC, options, open_capture=open_capture)
    return VideoCamera(SPEC, source, SystemClock(), options.timeout), captures


async def test_frames_that_grew_old_in_the_buffers_are_not_taken(vivid: str) -> None:
    camera, captures = drowsy(vivid)
    async with opened(camera):
        for _ in range(3):
            captures[0].ages.clear()
            captures[0].sleep = 1.0
            await asyncio.sleep(1.2)
            asked = time.monotonic()
            frame = await camera.frame(after=asked)
            assert frame.timestamp >= asked
            assert max(captures[0].ages) > 0.5, "the kernel kept no old frame"


async def test_a_camera_without_frames_is_lost_and_found_again(vivid: str) -> None:
    camera = v4l2(vivid)
    async with opened(camera):
        inject(vivid, "percentage_of_dropped_buffers=100")
        assert "no new frame for 4 s" in await lost(camera)
    inject(vivid, "percentage_of_dropped_buffers=0")
    async with opened(camera):
        await camera.frame(after=time.monotonic())


@pytest.mark.parametrize("fault", ["inject_fatal_streaming_error=1", "disconnect=1"])
async def test_a_stream_that_breaks_is_lost_and_found_again(vivid: str, fault: str) -> None:
    camera = v4l2(vivid)
    async with opened(camera):
        inject(vivid, fault)
        assert "no new frame for 4 s" in await lost(camera)
    async with opened(camera):
        await camera.frame(after=time.monotonic())


@pytest.mark.parametrize("fault", ["inject_vidioc_reqbufs_error=1", "inject_vidioc_streamon_error=1"])
async def test_a_stream_that_does_not_start_at_once_starts_the_next_time(vivid: str, fault: str) -> None:
    inject(vivid, fault)
    camera = v4l2(vivid)
    with contextlib.suppress(DeviceLostError):  # OpenCV gets over some errors by itself
        async with opened(camera):
            pass
    async with opened(camera):
        await camera.frame(after=time.monotonic())


@pytest.mark.parametrize("fault", ["inject_v4l2_buf_flag_error=1", "inject_vidioc_qbuf_error=1"])
async def test_a_single_buffer_in_error_does_no_harm(vivid: str, fault: str) -> None:
    async with opened(v4l2(vivid)) as camera:
        for _ in range(2):
            inject(vivid, fault)
            asked = time.monotonic()
            assert (await camera.frame(after=asked)).timestamp >= asked


async def test_a_camera_that_was_unplugged_is_back_under_another_number(vivid: str) -> None:
    camera = v4l2(vivid)
    before = node(vivid)
    async with opened(camera):
        inject(vivid, "disconnect=1")
        assert "camera 'eye'" in await lost(camera)
    unload("vivid")
    assert "index0 is not there: plug it in" in await refused(camera)
    load("v4l2loopback", f"video_nr={before.removeprefix('/dev/video')}")
    try:
        load("vivid", "n_devs=1")
        assert node(vivid) != before
        async with opened(camera):
            await camera.frame(after=time.monotonic())
    finally:
        unload("v4l2loopback")


async def test_a_second_opener_is_refused(vivid: str) -> None:
    async with opened(v4l2(vivid)) as camera:
        assert "is held by another activecam" in await refused(v4l2(vivid))
        await camera.frame(after=time.monotonic())
    foreign = cv2.VideoCapture(vivid, cv2.CAP_V4L2)
    assert foreign.read()[0]
    assert "another program holds it" in await refused(v4l2(vivid))
    foreign.release()


def plates() -> Callable[[float], tuple[Any, Any]]:
    """Return what a camera on a slide sees of a plate, and where its points truly are, at a position (mm)."""
    world = rigs.world(SystemClock(), lens={"fx": "500 px", "fy": "500 px", "cx": "320 px", "cy": "180 px"})
    exposure = Exposure(world, SPEC.width, SPEC.height)

    def seen(position: float) -> tuple[Any, Any]:
        readings = [position, 0.0]
        picture = exposure.picture([world.world_from_camera(readings)], np.random.default_rng(1))
        return picture, world.project(world.target_points(), readings)

    return seen


async def test_pushed_pictures_of_a_plate_show_where_it_is_and_never_where_it_was(loopback: str) -> None:
    seen = plates()
    target = CircleGrid.model_validate(rigs.TARGETS["circle_grid"])
    picture, _ = seen(0.0)
    with Pusher(loopback, picture) as pusher:
        async with opened(v4l2(loopback)) as camera:
            for position in (12.0, -20.0, 5.0):
                picture, points = seen(position)
                pusher.show(picture)
                await asyncio.sleep(0.1)  # the one that was being written may still be of the place before
                frame = await camera.frame(after=time.monotonic())
                found = detect(frame.image, target)
                assert len(found.ids) == 42
                error = found.pixels - points[found.ids]
                assert np.sqrt((error**2).sum(axis=1).mean()) < 0.1


async def test_a_loopback_without_a_writer_is_lost_and_found_again(loopback: str) -> None:
    picture, _ = plates()(0.0)
    camera = v4l2(loopback)
    with Pusher(loopback, picture):
        await camera.open()
    assert "no new frame for 4 s" in await lost(camera)
    await camera.close()
    with Pusher(loopback, picture):
        async with opened(camera):
            await camera.frame(after=time.monotonic())
