"""The emulated network camera as a client without OpenCV sees it."""

import asyncio
from collections.abc import AsyncIterator

import cv2
import numpy as np
import pytest

from calib.detection import detect
from calib.targets import CircleGrid
from drivers.camera import CameraSpec
from drivers.clock import SystemClock
from drivers.driver import DriverContext
from drivers.emulators.camera import LATENCY, QUALITY, StreamEmulator
from drivers.emulators.emulator import Emulator
from drivers.emulators.registry import camera_emulator
from drivers.errors import OptionsError
from drivers.video.options import StreamOptions, V4l2Options
from tests.drivers import rigs

SPEC = CameraSpec("eye", 640, 480)
LENS = {"fx": "700 px", "fy": "700 px", "cx": "320 px", "cy": "240 px"}


@pytest.fixture
async def camera() -> AsyncIterator[StreamEmulator]:
    clock = SystemClock()
    context = DriverContext(clock, rigs.world(clock, lens=LENS))
    running = StreamEmulator.create(SPEC, V4l2Options(device="/dev/video0"), context)
    await running.start()
    yield running
    await running.close()


async def parts(camera: StreamEmulator, count: int) -> list[tuple[dict[str, str], bytes]]:
    reader, writer = await asyncio.open_connection("127.0.0.1", camera.port)
    writer.write(b"GET /stream.mjpg HTTP/1.0\r\n\r\n")
    head = await reader.readuntil(b"\r\n\r\n")
    assert b"multipart/x-mixed-replace; boundary=frame" in head
    found = []
    for _ in range(count):
        lines = (await reader.readuntil(b"\r\n\r\n")).decode().strip().split("\r\n")
        assert lines.pop(0) == "--frame"
        headers = dict(line.split(": ") for line in lines)
        found.append((headers, await reader.readexactly(int(headers["Content-Length"]))))
        assert await reader.readexactly(2) == b"\r\n"
    writer.transport.abort()
    return found


async def test_each_part_is_a_picture_with_the_time_of_its_exposure(camera: StreamEmulator) -> None:
    before = SystemClock().now()
    found = await parts(camera, 3)
    stamps = [float(headers["X-Timestamp"]) for headers, _ in found]
    assert before - 1 < stamps[0] < stamps[1] < stamps[2] < SystemClock().now()
    for headers, jpeg in found:
        assert headers["Content-Type"] == "image/jpeg"
        image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_UNCHANGED)
        assert image is not None
        assert image.shape == (480, 640)


async def test_faults_are_injected_by_name_and_undone(camera: StreamEmulator) -> None:
    assert isinstance(camera, Emulator)
    (_, whole), (_, other) = await parts(camera, 2)
    assert whole != other
    camera.faults["truncate"].inject()
    [(_, half)] = await parts(camera, 1)
    assert whole.endswith(b"\xff\xd9")
    assert not half.endswith(b"\xff\xd9")
    camera.faults["repair"].inject()
    camera.faults["repeat"].inject()
    first, *rest = [jpeg for _, jpeg in await parts(camera, 3)]
    assert rest == [first, first]
    camera.faults["unplug"].inject()
    with pytest.raises(ConnectionRefusedError):
        await parts(camera, 1)


async def test_a_pictures_points_stay_where_they_were_before_its_compression() -> None:
    world = rigs.world(SystemClock(), lens=LENS)
    emulator = StreamEmulator(SPEC, {}, world)
    poses = [world.world_from_camera([0.0, 0.0])]
    raw = emulator._exposure.picture(poses, np.random.default_rng(1))
    jpeg = emulator._picture(poses, np.random.default_rng(1))
    sent = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_UNCHANGED)
    target = CircleGrid.model_validate(rigs.TARGETS["circle_grid"])
    assert sent is not None
    assert QUALITY >= 95
    moved = detect(sent, target).pixels - detect(raw, target).pixels
    assert np.sqrt((moved**2).mean()) < 0.01


async def test_the_profile_to_serve_names_the_stream_and_keeps_what_it_said_of_it() -> None:
    clock = SystemClock()
    context = DriverContext(clock, rigs.world(clock, lens=LENS))
    options = StreamOptions(url="http://nowhere", latency="1500 ms", timeout="9 s")
    emulator = camera_emulator("stream").create(SPEC, options, context)
    keys = await emulator.start()
    await emulator.close()
    assert isinstance(emulator, StreamEmulator)
    assert keys == {
        "driver": "stream",
        "options": {"url": emulator.url, "latency": "1.5 s", "timeout": "9.0 s"},
    }


async def test_a_v4l2_camera_is_emulated_by_a_stream() -> None:
    clock = SystemClock()
    context = DriverContext(clock, rigs.world(clock, lens=LENS))
    emulator = camera_emulator("v4l2").create(SPEC, V4l2Options(device="/dev/video0"), context)
    keys = await emulator.start()
    await emulator.close()
    assert isinstance(emulator, StreamEmulator)
    assert keys == {"driver": "stream", "options": {"url": emulator.url, "latency": LATENCY}}


def test_without_a_world_there_is_nothing_to_see() -> None:
    with pytest.raises(OptionsError, match=r"add a \[simulation\] table"):
        StreamEmulator.create(SPEC, V4l2Options(device="/dev/video0"), DriverContext(SystemClock()))
