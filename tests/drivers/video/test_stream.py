"""The stream driver over the emulated network camera, and what network cameras do wrong."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Iterable
from itertools import cycle
from typing import Any

import cv2
import numpy as np
import pytest

from drivers.camera import CameraSpec, Image
from drivers.clock import SystemClock
from drivers.contract import CameraBench, CameraContract
from drivers.driver import DriverContext
from drivers.emulators.camera import StreamEmulator
from drivers.errors import DeviceLostError, OptionsError
from drivers.simulated.motion import trapezoid
from drivers.video.options import StreamOptions
from drivers.video.stream import StreamCamera, StreamSource
from tests.drivers import rigs

SPEC = CameraSpec("eye", 320, 240)
LENS = {"fx": "350 px", "fy": "350 px", "cx": "160 px", "cy": "120 px"}


def emulator(**camera: Any) -> StreamEmulator:
    clock = SystemClock()
    world = rigs.world(clock, lens=LENS, **camera)
    options = StreamOptions(url="http://nowhere", latency="4 s")
    return StreamEmulator.create(SPEC, options, DriverContext(clock, world))


def stream(url: str, spec: CameraSpec = SPEC, **options: Any) -> StreamCamera:
    whole = {"url": url, "latency": "4 s", "exposure": "10 ms", "timeout": "3 s"} | options
    return StreamCamera.create(spec, StreamOptions.model_validate(whole), DriverContext(SystemClock()))


@pytest.fixture
async def camera() -> AsyncIterator[StreamEmulator]:
    running = emulator()
    await running.start()
    yield running
    await running.close()


class TestStreamContract(CameraContract):
    @pytest.fixture(autouse=True)
    async def running(self, camera: StreamEmulator) -> None:
        self.emulator = camera

    def bench(self) -> CameraBench:
        return CameraBench(
            stream(self.emulator.url, latency="1500 ms"), SystemClock(), unplug=self.emulator.unplug
        )


async def test_a_frame_shows_where_the_camera_was_when_it_was_asked_for_and_not_before() -> None:
    running = emulator(picture={"noise": 1.0, "exposure": "5 ms"})
    await running.start()
    source = stream(running.url, latency="1500 ms")
    await source.open()
    world = running._world
    _, slide = world.shaft("slide")
    before = (await source.frame()).image
    slide.drive(trapezoid(0.0, 60.0, time.monotonic(), velocity=400.0, acceleration=4000.0))
    frame = await source.frame(after=slide.motion.ends)
    still = await source.frame(after=time.monotonic())
    await source.close()
    await running.close()
    assert np.abs(frame.image.astype(int) - before).mean() > 5
    assert np.abs(frame.image.astype(int) - still.image).mean() < 5


async def test_a_frame_is_stamped_by_its_arrival_less_latency_and_exposure(camera: StreamEmulator) -> None:
    source = stream(camera.url, latency="3 s", exposure="20 ms")
    await source.open()
    after = time.monotonic()
    frame = await source.frame(after=after - 3.0)
    assert after - 3.0 <= frame.timestamp <= time.monotonic() - 3.02
    assert frame.exposure == pytest.approx(0.02)
    await source.close()


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        ("freeze", "has delivered no new frame|ended or broken off"),
        ("repeat", "has delivered no new frame for 1 s"),
        ("truncate", "has delivered no new frame for 1 s"),
        ("unplug", "has ended or broken off"),
    ],
)
async def test_a_camera_that_fails_is_lost_and_found_again(
    camera: StreamEmulator, fault: str, sentence: str
) -> None:
    source = stream(camera.url, timeout="1 s", latency="1 min")
    await source.open()
    last = await source.frame()
    camera.faults[fault].inject()
    with pytest.raises(DeviceLostError, match=sentence):
        await source.frame(after=time.monotonic() + 30)
    await source.close()
    camera.repair()
    found = stream(camera.url)
    await reopen(found)
    assert (await found.frame(after=last.timestamp + 1e-3)).timestamp > last.timestamp
    await found.close()


async def reopen(camera: StreamCamera) -> None:
    """Open a camera that may need some attempts, as its owner does."""
    for _ in range(100):
        with contextlib.suppress(DeviceLostError):
            await camera.open()
            return
        await asyncio.sleep(0.05)
    pytest.fail("the camera was not found again")


async def test_a_stream_that_fell_behind_is_opened_anew(camera: StreamEmulator) -> None:
    source = stream(camera.url, latency="2 s", timeout="20 s")
    await source.open()
    connections: set[object] = set(camera._clients)
    camera.delay("1.5")
    asked = time.monotonic()
    frame = await source.frame(after=asked)
    assert frame.timestamp >= asked
    assert connections.isdisjoint(camera._clients)
    await source.close()


async def test_a_stream_that_may_be_later_than_the_profile_says_is_lost(camera: StreamEmulator) -> None:
    source = stream(camera.url, latency="400 ms", timeout="20 s")
    await source.open()
    camera.delay(1.5)
    with pytest.raises(
        DeviceLostError, match=r"sent nothing for .* s, and the profile states a latency of 0.4 s"
    ):
        await source.frame(after=time.monotonic() + 30)
    await source.close()


async def test_an_address_where_nothing_is_is_named() -> None:
    source = stream("http://127.0.0.1:9/stream")
    with pytest.raises(DeviceLostError, match=r"camera 'eye': http://127.0.0.1:9/stream cannot be opened"):
        await source.open()


async def test_pictures_of_another_size_are_an_error(camera: StreamEmulator) -> None:
    source = stream(camera.url, CameraSpec("eye", 640, 480))
    with pytest.raises(OptionsError, match=r"sends pictures of 320 x 240 and the profile says 640 x 480"):
        await source.open()


class ListCapture:
    """A stream of given pictures."""

    def __init__(self, images: Iterable[Image], fourcc: str) -> None:
        self.images = iter(images)
        self.fourcc = cv2.VideoWriter.fourcc(*fourcc)
        self.released = False

    def isOpened(self) -> bool:
        return True

    def read(self) -> tuple[bool, Image | None]:
        time.sleep(0.001)
        image = next(self.images, None)
        return image is not None, image

    def get(self, propId: int, /) -> float:
        return float(self.fourcc)

    def set(self, propId: int, value: float, /) -> bool:
        return True

    def release(self) -> None:
        self.released = True


def source_of(capture: ListCapture) -> StreamSource:
    options = StreamOptions(url="http://camera", latency="1 min")
    return StreamSource(SPEC, options, lambda _url, _timeout: capture)


def pictures(count: int) -> list[Image]:
    noise = np.random.default_rng(3)
    return [noise.integers(0, 255, (240, 320, 3)).astype(np.uint8) for _ in range(count)]


def test_what_came_while_the_stream_was_opened_is_dropped() -> None:
    begun = time.monotonic()

    def opened(_url: str, _timeout: float) -> ListCapture:
        time.sleep(0.05)
        return ListCapture(cycle(pictures(3)), "MJPG")

    source = StreamSource(SPEC, StreamOptions(url="http://camera", latency="1 min"), opened)
    source.open()
    # Pictures were read for as long as the opening took, which is more than had come in.
    assert time.monotonic() >= begun + 0.1
    assert source.read() is not None
    source.close()


@pytest.mark.parametrize(("fourcc", "kept"), [("MJPG", False), ("h264", True)])
def test_a_jpeg_whose_lower_part_is_that_of_the_picture_before_is_torn(fourcc: str, kept: bool) -> None:
    first, second, third = pictures(3)
    torn = second.copy()
    torn[200:] = first[200:]
    source = source_of(ListCapture([first, torn, third], fourcc))
    source.open()
    assert (source.read() is not None) == kept
    assert source.read() is not None
    source.close()


def test_a_picture_once_more_is_no_new_one() -> None:
    first, second = pictures(2)
    source = source_of(ListCapture([first, first.copy(), second], "h264"))
    source.open()
    assert source.read() is None
    assert source.read() is not None
    with pytest.raises(DeviceLostError, match="http://camera has ended or broken off"):
        source.read()
    source.close()


def test_a_stream_without_a_picture_is_lost() -> None:
    capture = ListCapture([], "MJPG")
    source = source_of(capture)
    with pytest.raises(DeviceLostError, match="http://camera sends no pictures"):
        source.open()
    source.close()
    assert capture.released
