"""A camera of the kernel's Video4Linux, by OpenCV: frames stamped by the device's driver."""

import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import ClassVar, Final, Self

import cv2

from drivers.camera import CameraSpec
from drivers.driver import DriverContext
from drivers.errors import DeviceLostError
from drivers.video.camera import VideoCamera
from drivers.video.options import V4l2Options
from drivers.video.settings import exposure_of, set_controls, set_format
from drivers.video.source import Capture, Picture
from drivers.video.v4l2_node import DeviceNode, Node

FARTHEST_AHEAD: Final = 1.0
FARTHEST_BEHIND: Final = 10.0
"""Seconds between a frame's stamp and its arrival, beyond which the stamp is of another clock."""
ASSUMED_RATE: Final = 10.0
"""Frames a second of a camera that does not tell."""


class V4l2Camera(VideoCamera):
    """A camera with `driver = "v4l2"`."""

    Options: ClassVar[type[V4l2Options]] = V4l2Options

    @classmethod
    def create(cls, spec: CameraSpec, options: V4l2Options, context: DriverContext) -> Self:
        """Make a camera that is not open yet."""
        return cls(spec, V4l2Source(spec, options), context.clock, options.timeout)


def _open_capture(device: str) -> Capture:
    # OpenCV would wait 10 s for a frame, and nothing could be closed meanwhile.
    os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")
    return cv2.VideoCapture(device, cv2.CAP_V4L2)


class V4l2Source:
    """Reads one device. A picture's `began` is early rather than late.

    A driver stamps the end of a frame or the arrival of its first bytes, and OpenCV does not tell which. So the
    stamp is taken for the end of the readout, and latency and exposure are taken off. Stamps that run ahead of
    their arrival show that the driver's notion of time does: the farthest that was seen is taken off as well.
    """

    def __init__(
        self,
        spec: CameraSpec,
        options: V4l2Options,
        open_node: Callable[[str, str], Node] = DeviceNode,
        open_capture: Callable[[str], Capture] = _open_capture,
    ) -> None:
        self._spec = spec
        self._options = options
        self._open_node = open_node
        self._open_capture = open_capture
        self._node: Node | None = None
        self._capture: Capture | None = None
        self._exposure = self._latency = 0.0
        self._stamp = 0.0
        self._ahead = 0.0
        """How far stamps were seen to be ahead of their arrival (s)."""

    def open(self) -> Sequence[str]:
        """Open the device, set it and read back what it does; see `Source.open`."""
        name, device = self._spec.name, self._options.device
        self._node = self._open_node(name, device)
        self._capture = self._open_capture(device)
        if not self._capture.isOpened():
            raise DeviceLostError(
                f"camera '{name}': {device} cannot be opened: another program holds it, or it was just unplugged"
            )
        warnings = set_format(self._capture, self._spec, self._options)
        self._capture.read()  # there are cameras that take their controls only once they stream
        warnings += set_controls(self._node, name, self._options)
        rate = self._capture.get(cv2.CAP_PROP_FPS)
        period = 1.0 / (rate if rate > 0 else self._options.frame_rate or ASSUMED_RATE)
        self._exposure = exposure_of(self._node) or self._options.exposure or period
        self._latency = self._options.latency or period
        self._stamp = self._ahead = 0.0
        return warnings

    def read(self) -> Picture | None:
        """Return the next frame; see `Source.read`."""
        assert self._capture is not None
        read, image = self._capture.read()
        arrived = time.monotonic()
        if not read or image is None:
            self._require_present()
            return None
        stamp = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0
        if stamp <= self._stamp:
            return None  # the same frame once more, or an older one
        self._require_size(image.shape)
        self._require_clock(stamp, arrived)
        self._ahead = max(self._ahead, stamp - arrived)
        self._stamp = stamp
        return Picture(image, stamp - self._ahead - self._latency - self._exposure, self._exposure)

    def close(self) -> None:
        """Let the device go; see `Source.close`."""
        if self._capture is not None:
            self._capture.release()
        if self._node is not None:
            self._node.close()
        self._capture = self._node = None

    def _require_present(self) -> None:
        device = self._options.device
        if not Path(device).exists():
            raise DeviceLostError(f"camera '{self._spec.name}': {device} has gone: plug it in again")

    def _require_size(self, shape: tuple[int, ...]) -> None:
        if shape[:2] != (self._spec.height, self._spec.width):
            raise DeviceLostError(
                f"camera '{self._spec.name}' began to give pictures of {shape[1]} x {shape[0]} instead of "
                f"{self._spec.width} x {self._spec.height}: see that no other program sets it"
            )

    def _require_clock(self, stamp: float, arrived: float) -> None:
        if stamp <= 0 or not -FARTHEST_AHEAD < arrived - stamp < FARTHEST_BEHIND:
            raise DeviceLostError(
                f"camera '{self._spec.name}' stamps a frame {stamp:.3f} s when CLOCK_MONOTONIC is {arrived:.3f} s: "
                "have its driver use that clock (for USB cameras the uvcvideo option clock=CLOCK_MONOTONIC)"
            )
