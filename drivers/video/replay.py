"""Recorded pictures as a camera, for trying out: a folder of them, or a video file."""

import time
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import ClassVar, Final, Self

import cv2

from drivers.camera import CameraSpec, Image
from drivers.driver import DriverContext
from drivers.errors import DeviceLostError, OptionsError
from drivers.video.camera import VideoCamera
from drivers.video.options import ReplayOptions
from drivers.video.source import Picture

_OVERDUE: Final = 2.0
"""Seconds beyond its time that a picture may take to be read from the disk."""


class ReplayCamera(VideoCamera):
    """A camera with `driver = "replay"`: one picture after another, each exposed for the time that it is shown."""

    Options: ClassVar[type[ReplayOptions]] = ReplayOptions

    @classmethod
    def create(cls, spec: CameraSpec, options: ReplayOptions, context: DriverContext) -> Self:
        """Make a camera that is not open yet."""
        return cls(spec, ReplaySource(spec, options), context.clock, 1.0 / options.frame_rate + _OVERDUE)


class ReplaySource:
    """Reads one folder or file at the pace of its frame rate."""

    def __init__(self, spec: CameraSpec, options: ReplayOptions) -> None:
        self._spec = spec
        self._options = options
        self._period = 1.0 / options.frame_rate
        self._images: Iterator[Image] = iter(())
        self._began = 0.0
        """CLOCK_MONOTONIC when the picture to be read next begins to be shown."""

    def open(self) -> Sequence[str]:
        """Begin with the first picture; see `Source.open`."""
        self._images = self._read_all()
        first = next(self._images, None)
        if first is None:
            raise DeviceLostError(
                f"camera '{self._spec.name}': there are no pictures in {self._options.path}"
            )
        self._images = chain([first], self._images)
        self._began = time.monotonic()
        return ()

    def read(self) -> Picture | None:
        """Return the next picture when it has been shown for its time; see `Source.read`."""
        image = next(self._images, None)
        if image is None and self._options.loop:
            self._images = self._read_all()
            image = next(self._images, None)
        if image is None:
            raise DeviceLostError(f"camera '{self._spec.name}': {self._options.path} has ended")
        began = max(self._began, time.monotonic() - self._period)  # a slow disk does not add up
        self._began = began + self._period
        time.sleep(max(0.0, self._began - time.monotonic()))
        return Picture(image, began, self._period)

    def close(self) -> None:
        """Forget where it was; see `Source.close`."""
        self._images = iter(())

    def _read_all(self) -> Iterator[Image]:
        path = self._options.path
        pictures = _folder(path) if path.is_dir() else _video(path)
        return (self._checked(where, image) for where, image in pictures)

    def _checked(self, where: Path, image: Image | None) -> Image:
        if image is None:
            raise DeviceLostError(f"camera '{self._spec.name}': {where} is not a picture that OpenCV reads")
        height, width = image.shape[:2]
        if (width, height) != (self._spec.width, self._spec.height):
            raise OptionsError(
                f"camera '{self._spec.name}': {where} is {width} x {height} and the profile says "
                f"{self._spec.width} x {self._spec.height}"
            )
        return image


def _folder(folder: Path) -> Iterator[tuple[Path, Image | None]]:
    for path in sorted(folder.iterdir()):
        if path.is_file() and not path.name.startswith("."):
            yield path, cv2.imread(str(path), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR)


def _video(path: Path) -> Iterator[tuple[Path, Image | None]]:
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    try:
        while True:
            read, image = capture.read()
            if not read:
                return
            yield path, image
    finally:
        capture.release()
