"""Where a video camera's pictures come from: the one seam between a library that blocks and the rest."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from drivers.camera import Image


@dataclass(frozen=True, slots=True)
class Picture:
    """What was exposed from `began` on, for `exposure` seconds; `began` is CLOCK_MONOTONIC (s)."""

    image: Image
    began: float
    exposure: float


class Source(Protocol):
    """Opened, read and closed in one thread, which is all that calls it."""

    def open(self) -> Sequence[str]:
        """Start, and return in sentences what is not as the profile asks or a calibration needs it.

        Raises DriverError; nothing is left open then.
        """
        ...

    def read(self) -> Picture | None:
        """Return the next picture, waiting for it for about a second at most; None where none came that is new.

        Raises DeviceLostError when there is no hope of another one.
        """
        ...

    def close(self) -> None:
        """Let go of what there is; never fails."""
        ...


class Capture(Protocol):
    """What is used of `cv2.VideoCapture`, so that tests can be one.

    OpenCV raises nothing: `read` returns False, at once and for ever when the device is gone, `isOpened` stays
    True, and `set` returns True for what is then not obeyed.
    """

    def isOpened(self) -> bool:  # noqa: D102
        ...

    def read(self) -> tuple[bool, Image | None]:  # noqa: D102
        ...

    def get(self, propId: int, /) -> float:  # noqa: D102
        ...

    def set(self, propId: int, value: float, /) -> bool:  # noqa: D102
        ...

    def release(self) -> None:  # noqa: D102
        ...
