"""What V4L2 cameras were seen to do behind OpenCV, each as a trap that the driver does not fall into."""

import asyncio
import os
import threading
import time
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import cv2
import pytest

from drivers.camera import CameraSpec
from drivers.clock import ScaledClock, SystemClock
from drivers.contract import CameraBench, CameraContract
from drivers.driver import Cautious, DriverContext
from drivers.errors import DeviceLostError, DeviceTimeoutError, OptionsError
from drivers.video import grabber
from drivers.video.camera import VideoCamera
from drivers.video.options import V4l2Options
from drivers.video.v4l2 import V4l2Camera, V4l2Source
from drivers.video.v4l2_node import Control, control_name
from tests.drivers.video.captures import WEBCAM, FakeCapture, FakeNode

SPEC = CameraSpec("eye", 64, 48)


class Rig:
    """A camera, the fake device behind it, and how often it was opened."""

    def __init__(
        self,
        capture: FakeCapture | None = None,
        node: FakeNode | None = None,
        spec: CameraSpec = SPEC,
        **options: Any,
    ) -> None:
        self.capture = FakeCapture() if capture is None else capture
        self.node = FakeNode(WEBCAM) if node is None else node
        self.opened = 0
        whole = {"device": "/dev/null", "timeout": "1 s", "latency": "1 ms", "exposure": "5 ms"} | options
        self.options = V4l2Options.model_validate(whole)
        source = V4l2Source(spec, self.options, lambda _camera, _device: self.node, self._open)
        self.camera = VideoCamera(spec, source, SystemClock(), self.options.timeout)

    def _open(self, device: str) -> FakeCapture:
        self.opened += 1
        return self.capture.reopened()

    @asynccontextmanager
    async def open(self) -> AsyncIterator[VideoCamera]:
        await self.camera.open()
        try:
            yield self.camera
        finally:
            await self.camera.close()


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


# What is set is read back.


async def test_a_width_alone_does_nothing_so_that_the_height_is_set_after_it() -> None:
    rig = Rig(spec=CameraSpec("eye", 1280, 720))
    async with rig.open() as camera:
        assert (await camera.frame()).image.shape == (720, 1280, 3)


async def test_a_size_that_the_camera_does_not_have_is_an_error() -> None:
    rig = Rig(spec=CameraSpec("eye", 999, 720))
    with pytest.raises(OptionsError, match=r"gives pictures of 1280 x 720 and was asked for 999 x 720"):
        await rig.camera.open()


async def test_rate_format_and_buffers_that_are_not_obeyed_are_told_of() -> None:
    rig = Rig(frame_rate="50 Hz", pixel_format="MJPG", buffers=1)
    rig.capture.obeys_rate = rig.capture.obeys_format = rig.capture.obeys_buffers = False
    async with rig.open() as camera:
        warnings = list(camera.warnings)
    assert [warning.split(": ")[0] for warning in warnings] == [
        "camera 'eye' gives pictures as YUYV and was asked for MJPG",
        "camera 'eye' gives 100 frames a second and was asked for 50",
        "camera 'eye' keeps 4 frames waiting and was asked for 1",
    ]


async def test_nothing_is_told_of_a_camera_that_obeys() -> None:
    rig = Rig(frame_rate="50 Hz", pixel_format="MJPG", buffers=1, controls={"gain": 12})
    async with rig.open() as camera:
        assert isinstance(camera, Cautious)
        assert list(camera.warnings) == []
    assert rig.capture.rate == 50.0
    assert rig.node.values["gain"] == 12


async def test_what_the_camera_does_by_itself_is_switched_off_before_anything_is_set() -> None:
    rig = Rig(exposure="8 ms", controls={"focus_absolute": 40})
    async with rig.open() as camera:
        assert (await camera.frame()).exposure == pytest.approx(0.008)
    values = rig.node.values
    assert values["auto_exposure"] == 1
    assert values["exposure_time_absolute"] == 80
    assert values["focus_automatic_continuous"] == values["white_balance_automatic"] == 0
    assert values["focus_absolute"] == 40
    switches = ("auto_exposure", "focus_automatic_continuous", "white_balance_automatic")
    assert sorted(rig.node.order[:3]) == sorted(switches)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("auto_exposure", "sets its exposure by itself"),
        ("focus_automatic_continuous", "focuses by itself, which moves the lens that is being calibrated"),
        ("white_balance_automatic", "sets its white balance by itself"),
    ],
)
async def test_what_cannot_be_switched_off_is_told_of(name: str, sentence: str) -> None:
    rig = Rig()
    rig.node.stuck.add(name)
    async with rig.open() as camera:
        warnings = list(camera.warnings)
    assert len(warnings) == 1
    assert sentence in warnings[0]
    assert f"cannot be kept from it ({name})" in warnings[0]


async def test_automatic_gain_cannot_be_switched_off() -> None:
    gain = {"gain_automatic": (Control(0x00980912, "gain_automatic", 0, 1, 1), 1)}
    rig = Rig(node=FakeNode(gain | WEBCAM))
    rig.node.failing.add("gain_automatic")
    async with rig.open() as camera:
        assert ["gain by itself" in warning for warning in camera.warnings] == [True]


async def test_what_the_profile_leaves_on_is_told_of() -> None:
    rig = Rig(exposure=None, controls={"auto_exposure": 3})
    async with rig.open() as camera:
        assert list(camera.warnings) == [
            "camera 'eye' sets its exposure by itself, so that pictures are blurred and bright as it likes, "
            "as the profile asks (auto_exposure)"
        ]


async def test_a_control_that_is_not_obeyed_is_told_of() -> None:
    rig = Rig(controls={"gain": 12})
    rig.node.stuck.add("gain")
    async with rig.open() as camera:
        assert "camera 'eye' has gain at 30 and was asked for 12" in camera.warnings[0]


@pytest.mark.parametrize(
    ("controls", "message"),
    [
        ({"gain": 300}, r"cannot have gain at 300: its range is 0 to 255"),
        ({"zoom": 1}, r"has no control 'zoom': it has auto_exposure, exposure_time_absolute, gain"),
    ],
)
async def test_a_control_that_would_be_clamped_or_is_not_there_is_an_error(
    controls: Mapping[str, int], message: str
) -> None:
    rig = Rig(controls=controls)
    with pytest.raises(OptionsError, match=message):
        await rig.camera.open()
    assert rig.capture.released == rig.node.closed == 1


# The device node.


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
