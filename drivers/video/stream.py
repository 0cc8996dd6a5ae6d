"""A camera that sends a stream: whatever OpenCV opens by URL, such as RTSP, or MJPEG over HTTP.

A stream carries no time that OpenCV would tell. A frame's exposure is taken to have begun `latency` and
`exposure` before the frame arrived, which is safe as long as nothing arrives later than `latency`:

* frames are read without pause, so that none grows old on this side;
* those that came while the stream was being opened are read and dropped;
* a pause of more than half the latency may be followed by frames that much late, so that the stream is opened anew,
  which leaves what has queued up on the way behind. With a latency of twice what was measured the other half is what
  frames take at other times. After a pause of more than all of it the stream counts as lost;
* a picture that is equal to the one before it in every pixel comes from a server that has no new one;
* in what a JPEG lacks that was cut off, the decoder leaves the picture before it: one whose lowest rows are equal to
  those before is torn. Other codecs repeat what stands still, so that there only whole pictures are compared.
"""

import logging
import time
from collections.abc import Callable, Sequence
from itertools import chain
from typing import ClassVar, Final, Self

import cv2
import numpy as np

from drivers.camera import CameraSpec, Image
from drivers.driver import DriverContext
from drivers.errors import DeviceLostError, OptionsError
from drivers.video.camera import VideoCamera
from drivers.video.options import StreamOptions
from drivers.video.source import Capture, Picture

logger = logging.getLogger(__name__)

_BLOCK: Final = 8
"""Rows of a JPEG that are decoded together."""


class StreamCamera(VideoCamera):
    """A camera with `driver = "stream"`."""

    Options: ClassVar[type[StreamOptions]] = StreamOptions

    @classmethod
    def create(cls, spec: CameraSpec, options: StreamOptions, context: DriverContext) -> Self:
        """Make a camera that is not open yet."""
        return cls(spec, StreamSource(spec, options), context.clock, options.timeout)


def _open_capture(url: str, timeout: float) -> Capture:
    limit = round(1000 * timeout)
    # Each further thread of the decoder would hold back one frame.
    settings = {
        cv2.CAP_PROP_OPEN_TIMEOUT_MSEC: limit,
        cv2.CAP_PROP_READ_TIMEOUT_MSEC: limit,
        cv2.CAP_PROP_N_THREADS: 1,
    }
    return cv2.VideoCapture(url, cv2.CAP_FFMPEG, list(chain(*settings.items())))


class StreamSource:
    """Reads one stream, and opens it anew when it falls behind."""

    def __init__(
        self,
        spec: CameraSpec,
        options: StreamOptions,
        open_capture: Callable[[str, float], Capture] = _open_capture,
    ) -> None:
        self._spec = spec
        self._options = options
        self._open_capture = open_capture
        self._capture: Capture | None = None
        self._compared = slice(None)
        """Rows in which a picture has to differ from the one before."""
        self._arrived = 0.0
        self._previous: Image | None = None

    def open(self) -> Sequence[str]:
        """Connect, and drop what came meanwhile; see `Source.open`."""
        name, url = self._spec.name, self._options.url
        began = time.monotonic()
        self._capture = self._open_capture(url, self._options.timeout)
        if not self._capture.isOpened():
            raise DeviceLostError(
                f"camera '{name}': {url} cannot be opened: check the address, and that the camera sends there"
            )
        opened = time.monotonic()
        image = None
        # Reading is faster than sending: what came in while it was opened is gone in less time than that took.
        while image is None or time.monotonic() < opened + (opened - began):
            read, image = self._capture.read()
            if not read or image is None:
                raise DeviceLostError(f"camera '{name}': {url} sends no pictures")
        self._require_size(image)
        torn_like_jpeg = int(self._capture.get(cv2.CAP_PROP_FOURCC)) == cv2.VideoWriter.fourcc(*"MJPG")
        self._compared = slice(-_BLOCK if torn_like_jpeg else None, None)
        self._arrived, self._previous = time.monotonic(), image
        return ()

    def read(self) -> Picture | None:
        """Return the next frame; see `Source.read`."""
        assert self._capture is not None
        read, image = self._capture.read()
        arrived = time.monotonic()
        if not read or image is None:
            raise DeviceLostError(f"camera '{self._spec.name}': {self._options.url} has ended or broken off")
        pause, self._arrived = arrived - self._arrived, arrived
        if pause > self._options.latency:
            raise DeviceLostError(
                f"camera '{self._spec.name}' sent nothing for {pause:.2f} s, and the profile states a latency of "
                f"{self._options.latency:g} s at most: see what holds it up, or state a longer one"
            )
        if pause > 0.5 * self._options.latency:
            self._open_anew(pause)
            return None
        self._require_size(image)
        previous, self._previous = self._previous, image
        if previous is not None and np.array_equal(image[self._compared], previous[self._compared]):
            return None
        began = arrived - self._options.latency - self._options.exposure
        return Picture(image, began, self._options.exposure)

    def close(self) -> None:
        """Disconnect; see `Source.close`."""
        if self._capture is not None:
            self._capture.release()
        self._capture = self._previous = None

    def _open_anew(self, pause: float) -> None:
        logger.warning(
            "camera '%s' sent nothing for %.2f s, and may be that late from now on: it is opened anew",
            self._spec.name,
            pause,
        )
        self.close()
        self.open()

    def _require_size(self, image: Image) -> None:
        height, width = image.shape[:2]
        if (width, height) != (self._spec.width, self._spec.height):
            raise OptionsError(
                f"camera '{self._spec.name}' sends pictures of {width} x {height} and the profile says "
                f"{self._spec.width} x {self._spec.height}: set either to the other"
            )
