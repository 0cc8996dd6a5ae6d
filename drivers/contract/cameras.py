"""The contract of cameras (`drivers.camera`) as tests."""
# ruff: noqa: D102 (a test's name is its sentence)

import asyncio
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from drivers.camera import CameraSource, Frame
from drivers.clock import Clock
from drivers.contract.expectations import expect, refused
from drivers.errors import DeviceLostError


@dataclass(frozen=True)
class CameraBench:
    """A camera to be tested, not open yet."""

    camera: CameraSource
    clock: Clock
    unplug: Callable[[], None] | None = None
    """Takes the camera away, where that can be done; the loss of a camera is not tested without it."""


class CameraContract(ABC):
    """Subclass this, give it a `bench`, and a camera driver is tested."""

    @abstractmethod
    def bench(self) -> CameraBench:
        """Return a new camera to be tested; called once a test."""

    async def test_the_camera_is_known_before_opening(self) -> None:
        bench = self.bench()
        before = bench.camera.spec
        expect(isinstance(bench.camera, CameraSource), "the camera lacks a method of CameraSource")
        async with _opened(bench) as camera:
            expect(camera.spec == before, "opening changed the camera's specification")

    async def test_a_closed_camera_is_lost(self) -> None:
        bench = self.bench()
        with refused(DeviceLostError):
            await bench.camera.frame()

    async def test_a_frame_is_as_the_profile_says(self) -> None:
        async with _opened(self.bench()) as camera:
            frame = await camera.frame()
        expect(
            frame.image.shape[:2] == (camera.spec.height, camera.spec.width), "the picture has another size"
        )
        expect(frame.image.ndim == 2 or frame.image.shape[2:] == (3,), "the picture is neither grey nor BGR")
        expect(
            frame.image.dtype in {np.dtype(np.uint8), np.dtype(np.uint16)},
            "pixels have neither 8 nor 16 bits",
        )
        expect(frame.exposure > 0, "the exposure has no duration")

    async def test_frames_follow_each_other(self) -> None:
        async with _opened(self.bench()) as camera:
            frames = [await camera.frame()]
            for _ in range(4):
                frames.append(await camera.frame(after=_just_after(frames[-1])))
        for earlier, later in pairwise(frames):
            expect(later.sequence > earlier.sequence, "the sequence numbers do not grow")
            expect(later.timestamp > earlier.timestamp, "the frames' times do not grow")

    async def test_a_frame_is_exposed_after_the_time_asked_for(self) -> None:
        bench = self.bench()
        async with _opened(bench) as camera:
            for wait in (0.0, 0.01, 0.1):
                after = bench.clock.now() + wait
                frame = await camera.frame(after=after)
                expect(frame.timestamp >= after, "the exposure began before the time asked for")
                ends = frame.timestamp + frame.exposure
                expect(ends <= bench.clock.now(), "a frame was delivered before its exposure was over")

    async def test_the_newest_frame_is_not_older_than_one_seen_before(self) -> None:
        bench = self.bench()
        async with _opened(bench) as camera:
            first = await camera.frame(after=bench.clock.now())
            second = await camera.frame()
            third = await camera.frame(after=first.timestamp)
        expect(first.sequence <= second.sequence <= third.sequence, "an older frame came after a newer one")

    async def test_a_frame_stays_as_it_was_delivered(self) -> None:
        async with _opened(self.bench()) as camera:
            first = await camera.frame()
            kept = first.image.copy()
            await camera.frame(after=_just_after(first))
        expect(bool(np.array_equal(first.image, kept)), "a later frame was written over an earlier one")

    async def test_several_callers_are_served(self) -> None:
        bench = self.bench()
        async with _opened(bench) as camera:
            after = bench.clock.now()
            frames = await asyncio.gather(*(camera.frame(after=after) for _ in range(3)))
        expect(all(frame.timestamp >= after for frame in frames), "one of several callers got an old frame")

    async def test_a_closed_camera_opens_again(self) -> None:
        bench = self.bench()
        async with _opened(bench) as camera:
            first = await camera.frame()
        with refused(DeviceLostError):
            await camera.frame()
        async with _opened(bench) as camera:
            second = await camera.frame()
        expect(second.timestamp > first.timestamp, "after opening again the camera delivered an old frame")

    async def test_a_lost_camera_says_so(self) -> None:
        bench = self.bench()
        if bench.unplug is None:
            return
        async with _opened(bench) as camera:
            waiting = asyncio.create_task(camera.frame(after=bench.clock.now() + 60.0))
            await bench.clock.sleep(0.1)
            bench.unplug()
            with refused(DeviceLostError):
                await waiting
            with refused(DeviceLostError):
                await camera.frame()
            with refused(DeviceLostError):
                await camera.open()


@asynccontextmanager
async def _opened(bench: CameraBench) -> AsyncIterator[CameraSource]:
    await bench.camera.open()
    try:
        yield bench.camera
    finally:
        await bench.camera.close()


def _just_after(frame: Frame) -> float:
    return float(np.nextafter(frame.timestamp, np.inf))
