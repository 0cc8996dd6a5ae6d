"""A V4L2 camera as OpenCV shows it, with everything that real ones were seen to do."""

import threading
import time
from collections.abc import Mapping
from types import MappingProxyType

import cv2
import numpy as np

from drivers.camera import Image
from drivers.video.v4l2_node import Control

SELECT_TIMEOUT = 0.1
"""Seconds after which a read without frames gives up: 10 in life, or 1 by OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT."""

EXPOSURE, READOUT = 0.005, 0.001
"""Seconds, at the end of each frame's time."""

SIZES = ((64, 48), (320, 240), (1280, 720))


class FakeCapture:
    """Frames on a grid of CLOCK_MONOTONIC, in a queue of `buffers` that keeps the oldest of them.

    Every frame shows its own number in its first pixel.
    """

    def __init__(self, rate: float = 100.0, buffers: int = 4) -> None:
        self.rate = rate
        self.buffers = buffers
        self.obeys_rate = self.obeys_format = self.obeys_buffers = True
        self.size = (640, 480)
        self.opens = True
        self.ahead = 0.0
        """How far the stamps run before the truth (s)."""
        self.offset = 0.0
        """Of the stamps' clock to CLOCK_MONOTONIC (s)."""
        self.gone = self.mute = self.repeats = False
        self.reads = self.stale = 0
        """Reads in all, and those of frames that had waited for 0.1 s."""
        self.read_once = threading.Event()
        self.released = 0
        self._width = 0
        self._fourcc = cv2.VideoWriter.fourcc(*"YUYV")
        self._oldest = self._number(time.monotonic())
        """Number of the frame that the next read returns."""
        self._stamp = 0.0
        self._image: Image | None = None
        self._paused_until = 0.0
        self._let_go = threading.Event()

    def reopened(self) -> "FakeCapture":
        """Be the capture of the same device that is opened once more."""
        self._let_go.clear()
        self._oldest = self._number(time.monotonic())
        self.opens = self.opens and not self.gone
        return self

    def isOpened(self) -> bool:
        return self.opens

    def read(self) -> tuple[bool, Image | None]:
        self.reads += 1
        self.read_once.set()
        self._let_go.wait(self._paused_until - time.monotonic())
        if self.gone:
            return False, None
        if self.mute:
            self._let_go.wait(SELECT_TIMEOUT)
            return False, None
        if self.repeats and self._image is not None:
            self._let_go.wait(1 / self.rate)
            return True, self._image.copy()
        # The buffers filled up after the last read, and everything since then is lost.
        newest = self._number(time.monotonic()) - 2
        number = self._oldest
        if number > newest:
            self._let_go.wait(number / self.rate + 1 / self.rate - time.monotonic())
        waiting = min(max(newest, number), number + self.buffers - 1)
        self._oldest = number + 1 if number < waiting else max(number, newest) + 1
        width, height = self.size
        self._image = np.zeros((height, width, 3), np.uint8)
        self._image[0, 0] = number % 251
        self._stamp = (number + 1) / self.rate + self.ahead + self.offset
        self.stale += (number + 1) / self.rate < time.monotonic() - 0.1
        return True, self._image.copy()

    def get(self, propId: int, /) -> float:
        fourcc = self._fourcc if self.obeys_format else cv2.VideoWriter.fourcc(*"YUYV")
        return {
            cv2.CAP_PROP_FRAME_WIDTH: float(self.size[0]),
            cv2.CAP_PROP_FRAME_HEIGHT: float(self.size[1]),
            cv2.CAP_PROP_FPS: self.rate,
            cv2.CAP_PROP_FOURCC: float(fourcc),
            cv2.CAP_PROP_BUFFERSIZE: float(self.buffers),
            cv2.CAP_PROP_POS_MSEC: 1000 * self._stamp,
        }[propId]

    def set(self, propId: int, value: float, /) -> bool:
        if propId == cv2.CAP_PROP_FRAME_WIDTH:
            self._width = int(value)
        elif propId == cv2.CAP_PROP_FRAME_HEIGHT and self._width:
            wanted = (self._width, int(value))
            self.size = min(SIZES, key=lambda size: abs(size[0] - wanted[0]) + abs(size[1] - wanted[1]))
        elif propId == cv2.CAP_PROP_FPS and self.obeys_rate:
            self.rate = value
            self._oldest = self._number(time.monotonic())
        elif propId == cv2.CAP_PROP_FOURCC:
            self._fourcc = int(value)
        elif propId == cv2.CAP_PROP_BUFFERSIZE and self.obeys_buffers:
            self.buffers = int(value)
        return True

    def release(self) -> None:
        self.released += 1
        self._let_go.set()

    def pause(self, seconds: float) -> None:
        """Keep the reader from reading, as a busy machine does."""
        self._paused_until = time.monotonic() + seconds

    def stamped(self, image: Image) -> float:
        """Return the true end of a delivered picture, told by its number, which recurs after 251."""
        newest = self._number(time.monotonic())
        number = newest - (newest - int(image[0, 0, 0])) % 251
        return (number + 1) / self.rate

    def began(self, image: Image) -> float:
        """Return when the exposure of a delivered picture truly began."""
        return self.stamped(image) - READOUT - EXPOSURE

    def _number(self, t: float) -> int:
        return int(np.ceil(t * self.rate))


class FakeNode:
    """Controls with ranges, values that clamp, and some that do not obey."""

    def __init__(self, controls: Mapping[str, tuple[Control, int]] = MappingProxyType({})) -> None:
        self.controls = {name: control for name, (control, _) in controls.items()}
        self.values = {name: value for name, (_, value) in controls.items()}
        self.stuck: set[str] = set()
        self.failing: set[str] = set()
        self.order: list[str] = []
        self.closed = 0
        self.let_go = threading.Event()

    def get(self, control: Control) -> int:
        if control.name in self.failing:
            raise OSError(5, "Input/output error")
        return self.values[control.name]

    def set(self, control: Control, value: int) -> None:
        self.order.append(control.name)
        if control.name in self.failing:
            raise OSError(16, "Device or resource busy")
        if control.name not in self.stuck:
            self.values[control.name] = min(max(value, control.minimum), control.maximum)

    def close(self) -> None:
        self.closed += 1
        self.let_go.set()


def control(id_: int, name: str, value: int, low: int = 0, high: int = 255) -> dict[str, tuple[Control, int]]:
    return {name: (Control(id_, name, low, high, 1), value)}


WEBCAM = (
    control(0x009A0901, "auto_exposure", 3, 0, 3)
    | control(0x009A0902, "exposure_time_absolute", 157, 1, 5000)
    | control(0x00980913, "gain", 30)
    | control(0x0098090C, "white_balance_automatic", 1, 0, 1)
    | control(0x0098091A, "white_balance_temperature", 4000, 2800, 6500)
    | control(0x009A090C, "focus_automatic_continuous", 1, 0, 1)
    | control(0x009A090A, "focus_absolute", 0, 0, 250)
)
"""What a usual USB camera has."""
