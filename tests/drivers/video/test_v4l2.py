"""What V4L2 cameras were seen to do behind OpenCV, each as a trap that the driver does not fall into."""

import asyncio
import os
import threading
import time
from pathlib import Path

import cv2
import pytest

from drivers.clock import ScaledClock, SystemClock
from drivers.contract import CameraBench, CameraContract
from drivers.driver import DriverContext
from drivers.errors import DeviceLostError, DeviceTimeoutError, OptionsError
from drivers.video import grabber
from drivers.video.options import V4l2Options
from drivers.video.v4l2 import V4l2Camera, V4l2Source
from drivers.video.v4l2_node import control_name
from tests.drivers.video.captures import WEBCAM, FakeCapture, FakeNode
from tests.drivers.video.v4l2_rigs import SPEC, Rig


class TestV4l2Contract(CameraContract):
    def bench(self) -> CameraBench:
        rig = Rig()
        return CameraBench(rig.camera, SystemClock(), unplug=lambda: setattr(rig.capture, "gone", True))


async def test_a_frame_that_lay_in_a_buffer_during_a_pause_is_not_taken() -> None:
    rig = Rig(FakeCapture(rate=50.0))
    async with rig.open() as camera:
        for pause in range(1, 4):
            rig.capture.pause(0.3)
            after = time.monotonic() + 0.3
            frame = await camera.frame(after=after)
            assert rig.capture.stale >= pause, "the trap was not set"
            assert rig.capture.began(frame.image) >= after


async def test_frames_are_read_while_nobody_asks_for_them() -> None:
    rig = Rig()
    async with rig.open():
        before = rig.capture.reads
        deadline = time.monotonic() + 30
        while rig.capture.reads < before + 20:
            assert time.monotonic() < deadline
            await asyncio.sleep(0.01)


async def test_stamps_that_run_ahead_of_time_make_no_frame_newer_than_it_is() -> None:
    rig = Rig(FakeCapture(rate=50.0))
    rig.capture.ahead = 0.034
    async with rig.open() as camera:
        await camera.frame(after=time.monotonic())
        for _ in range(5):
            after = time.monotonic()
            frame = await camera.frame(after=after)
            assert rig.capture.began(frame.image) >= after
            assert frame.timestamp + frame.exposure <= time.monotonic()


async def test_the_stamp_is_taken_for_the_end_of_the_readout() -> None:
    rig = Rig(latency="20 ms", exposure="12 ms")
    async with rig.open() as camera:
        frame = await camera.frame()
    assert frame.exposure == pytest.approx(0.012)
    assert frame.timestamp == pytest.approx(rig.capture.stamped(frame.image) - 0.032, abs=1e-3)


async def test_without_a_stated_latency_it_is_one_frames_time() -> None:
    rig = Rig(FakeCapture(rate=20.0), latency=None)
    async with rig.open() as camera:
        frame = await camera.frame()
    assert frame.timestamp == pytest.approx(
        rig.capture.stamped(frame.image) - 0.05 - frame.exposure, abs=1e-3
    )


async def test_a_camera_that_tells_no_exposure_is_taken_to_expose_for_the_whole_frame() -> None:
    rig = Rig(FakeCapture(rate=20.0), FakeNode(), exposure=None)
    async with rig.open() as camera:
        assert (await camera.frame()).exposure == pytest.approx(0.05)
        assert any("does not tell its exposure" in warning for warning in camera.warnings)


@pytest.mark.parametrize("offset", [1.7e9, -1e9])
async def test_stamps_of_another_clock_are_refused(offset: float) -> None:
    rig = Rig()
    rig.capture.offset = offset
    with pytest.raises(DeviceLostError, match=r"when CLOCK_MONOTONIC is|has delivered no new frame"):
        await rig.camera.open()
    assert rig.capture.released == rig.node.closed == 1


async def test_a_camera_without_frames_is_lost_although_it_says_that_it_is_open() -> None:
    rig = Rig()
    async with rig.open() as camera:
        rig.capture.mute = True
        assert rig.capture.isOpened()
        with pytest.raises(DeviceLostError, match=r"no new frame for 1 s: check its cable"):
            await camera.frame(after=time.monotonic() + 0.1)
        with pytest.raises(DeviceLostError):
            await camera.frame()


async def test_a_device_that_is_gone_is_not_asked_again_and_again_in_no_time() -> None:
    rig = Rig()
    async with rig.open() as camera:
        rig.capture.gone = True
        before = rig.capture.reads
        with pytest.raises(DeviceLostError, match="no new frame"):
            await camera.frame(after=time.monotonic() + 5)
        # Doubling from 5 ms to 200 ms these are some ten in a second; without a pause they would be 100 000.
        assert rig.capture.reads - before < 50


async def test_a_device_whose_node_is_gone_is_lost_at_once(tmp_path: Path) -> None:
    rig = Rig(timeout="1 min")
    async with rig.open() as camera:
        object.__setattr__(rig.options, "device", str(tmp_path / "video0"))
        rig.capture.gone = True
        with pytest.raises(DeviceLostError, match=r"video0 has gone: plug it in again"):
            await camera.frame(after=time.monotonic() + 30)


async def test_a_camera_that_was_gone_is_opened_again() -> None:
    rig = Rig()
    async with rig.open() as camera:
        last = await camera.frame()
        rig.capture.gone = True
        with pytest.raises(DeviceLostError):
            await camera.frame(after=time.monotonic() + 5)
    with pytest.raises(DeviceLostError, match="another program holds it"):
        await rig.camera.open()
    rig.capture = FakeCapture()
    async with rig.open() as camera:
        first = await camera.frame()
    assert rig.opened == 3
    assert rig.node.closed == 3
    assert first.sequence > last.sequence
    assert first.timestamp > last.timestamp


async def test_a_repeated_frame_is_no_new_one() -> None:
    rig = Rig()
    async with rig.open() as camera:
        rig.capture.repeats = True
        with pytest.raises(DeviceLostError, match="no new frame"):
            await camera.frame(after=time.monotonic() + 0.05)


async def test_a_single_failed_read_does_not_lose_the_camera() -> None:
    rig = Rig()
    async with rig.open() as camera:
        rig.capture.mute = True
        await asyncio.sleep(0.05)
        rig.capture.mute = False
        after = time.monotonic()
        assert (await camera.frame(after=after)).timestamp >= after


async def test_a_library_that_fails_loses_the_camera_with_its_words(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig()

    def fail() -> None:
        raise cv2.error("-215: Assertion failed")

    async with rig.open() as camera:
        monkeypatch.setattr(rig.capture, "read", fail)
        with pytest.raises(DeviceLostError, match=r"camera 'eye' cannot be read: error: .*Assertion failed"):
            await camera.frame(after=time.monotonic() + 5)


async def test_a_picture_that_changes_its_size_loses_the_camera() -> None:
    rig = Rig()
    async with rig.open() as camera:
        rig.capture.size = (320, 240)
        with pytest.raises(DeviceLostError, match=r"began to give pictures of 320 x 240 instead of 64 x 48"):
            await camera.frame(after=time.monotonic() + 5)


async def test_a_second_opener_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig()
    rig.capture.opens = False
    with pytest.raises(DeviceLostError, match=r"camera 'eye': /dev/null cannot be opened: another program"):
        await rig.camera.open()
    assert rig.capture.released == rig.node.closed == 1


async def test_closing_does_not_wait_for_a_frame_that_never_comes() -> None:
    rig = Rig(timeout="1 min")
    async with rig.open():
        rig.capture.mute = True
    assert rig.capture.released == rig.node.closed == 1


async def test_who_waits_for_a_frame_is_told_when_the_camera_is_closed() -> None:
    rig = Rig(timeout="1 min")
    async with rig.open() as camera:
        rig.capture.mute = True
        rig.capture.read_once.clear()
        assert await asyncio.to_thread(rig.capture.read_once.wait, 30)  # no frame is on its way any more
        waiting = asyncio.create_task(camera.frame(after=time.monotonic() + 60))
        await asyncio.sleep(0)
    await asyncio.wait([waiting], timeout=20)
    assert waiting.done()
    with pytest.raises(DeviceLostError, match="camera 'eye' is not open: open it first"):
        await waiting


async def test_a_library_that_does_not_return_is_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(grabber, "JOIN_LIMIT", 0.1)
    rig = Rig(timeout="200 ms")
    await rig.camera.open()
    returns = threading.Event()

    def hang() -> tuple[bool, None]:
        returns.wait(60)
        return False, None

    monkeypatch.setattr(rig.capture, "read", hang)
    await asyncio.sleep(0.05)
    with pytest.raises(DeviceTimeoutError, match=r"camera 'eye' has not let go for 0.3 s: unplug it"):
        await rig.camera.close()
    returns.set()
    assert await asyncio.to_thread(rig.node.let_go.wait, 60)


async def test_an_opening_that_is_cancelled_lets_the_device_go() -> None:
    rig = Rig(timeout="1 min")
    rig.capture.mute = True
    opening = asyncio.create_task(rig.camera.open())
    assert await asyncio.to_thread(rig.capture.read_once.wait, 30)
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening
    assert rig.capture.released == rig.node.closed == 1


async def test_opencv_is_kept_from_waiting_ten_seconds_for_a_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "")
    monkeypatch.delenv("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT")
    seen: list[str | None] = []

    def opened(_device: str, _backend: int) -> FakeCapture:
        seen.append(os.environ.get("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT"))
        return FakeCapture()

    monkeypatch.setattr(cv2, "VideoCapture", opened)
    source = V4l2Source(SPEC, V4l2Options(device="/dev/null"), lambda _camera, _device: FakeNode(WEBCAM))
    source.open()
    source.close()
    assert seen == ["1"]


async def test_a_camera_that_is_not_there_is_lost() -> None:
    camera = V4l2Camera.create(SPEC, V4l2Options(device="/dev/v4l/by-id/none"), DriverContext(SystemClock()))
    with pytest.raises(DeviceLostError, match=r"camera 'eye': /dev/v4l/by-id/none is not there: plug it in"):
        await camera.open()


async def test_a_node_that_is_no_camera_is_an_error() -> None:
    camera = V4l2Camera.create(SPEC, V4l2Options(device="/dev/null"), DriverContext(SystemClock()))
    with pytest.raises(OptionsError, match=r"/dev/null delivers no pictures: .* ends in index0"):
        await camera.open()


def test_controls_are_named_as_v4l2_ctl_names_them() -> None:
    assert control_name("White Balance, Automatic") == "white_balance_automatic"
    assert control_name("Exposure Time, Absolute") == "exposure_time_absolute"


def test_a_real_camera_does_not_follow_a_clock_that_outruns_life() -> None:
    with pytest.raises(OptionsError, match=r"is real and takes its time"):
        V4l2Camera.create(SPEC, V4l2Options(device="/dev/null"), DriverContext(ScaledClock(20.0)))
