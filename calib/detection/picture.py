"""A camera's picture, made ready to search and to measure in."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import DetectionError

SMALLEST_SIDE = 32
SAMPLES = 10_000  # of the pixels; enough for the light, and to 1 % for the noise


@dataclass(frozen=True, eq=False)
class Picture:
    """One picture in two forms: `grey` to search in and `values` to measure in, both (height, width).

    `grey` has 8 bits, stretched so that the picture fills them, whatever its exposure and depth; `values` are
    the camera's own grey values. `noise` is the standard deviation of `values`.
    """

    grey: NDArray[np.uint8]
    values: NDArray[np.uint8 | np.uint16 | np.float32]
    noise: float

    @property
    def size(self) -> str:
        """Width and height, for a message."""
        height, width = self.grey.shape
        return f"{width} x {height} px"

    @cached_property
    def extremes(self) -> tuple[float, float]:
        """The least and the greatest of `values`: where a camera clips, if it does."""
        least, greatest, _, _ = cv2.minMaxLoc(self.values)
        return least, greatest

    @property
    def middle(self) -> NDArray[np.float64]:
        """The place (2,) about which a lens bends lines, more or less."""
        height, width = self.values.shape
        return np.array([width - 1, height - 1]) / 2


def read_picture(image: NDArray[np.generic]) -> Picture:
    """Take a grey, BGR or BGRA picture of 8 or 16 bits: (h, w), (h, w, 1), (h, w, 3) or (h, w, 4).

    Raises DetectionError where it is no such picture, or one in which nothing can be seen.
    """
    values = grey_values(image)
    apart = samples_apart(values)
    return Picture(_stretched(values, apart), values, noise_of(values, apart))


def samples_apart(values: NDArray[np.generic]) -> int:
    """Say how many px apart pixels are that tell enough of the light and the noise."""
    return max(round(sqrt(values.size / SAMPLES)), 1)


def grey_values(
    image: NDArray[np.generic], part: tuple[slice, slice] = (slice(None), slice(None))
) -> NDArray[np.uint8 | np.uint16]:
    """Return the grey values (h, w) of such a picture as they are, or of a part of it, rows and columns.

    Raises DetectionError where it is no such picture.
    """
    require_picture(image)
    depth = np.uint8 if image.dtype.itemsize == 1 else np.uint16
    return _as_grey(np.ascontiguousarray(image[part], dtype=depth))


def require_picture(image: NDArray[np.generic]) -> None:
    """Raise DetectionError, which says what it is, where an array is no such picture."""
    # OpenCV's readers return None for a file that is no picture, whatever the annotation says.
    if not isinstance(image, np.ndarray):
        raise DetectionError("there is no picture to look at: an array of grey or BGR values is needed")
    if image.dtype.kind != "u" or image.dtype.itemsize > 2:
        raise DetectionError(
            f"a picture has 8 or 16 bits (uint8, uint16) and this one is {image.dtype}: convert it first"
        )
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] not in (1, 3, 4)):
        raise DetectionError(
            f"a picture is (height, width) or (height, width, 3 or 4) and this array is {image.shape}"
        )
    height, width = image.shape[:2]
    if min(height, width) < SMALLEST_SIDE:
        raise DetectionError(
            f"a picture of {width} x {height} px is too small to hold a target: check the camera's format"
        )


def copies(grey: NDArray[np.uint8], side: int) -> Iterator[tuple[NDArray[np.uint8], float]]:
    """Give a copy that is quick to search, at most `side` px long, and then the picture; each with its scale.

    Of a strip whose copy would be too narrow to hold a target there is none.
    A pixel of the copy is the mean of a whole number of pixels, which takes a small part of the time of any other.
    """
    height, width = grey.shape
    times = -(-max(grey.shape) // side)
    small = width // times, height // times
    if times > 1 and min(small) >= SMALLEST_SIDE:
        whole = grey[: small[1] * times, : small[0] * times]
        yield np.asarray(cv2.resize(whole, small, interpolation=cv2.INTER_AREA)), 1 / times
    yield grey, 1.0


def in_original(pixels: NDArray[np.float64], scale: float) -> NDArray[np.float64]:
    """Take pixels (..., 2) of a copy to the original: they share their outline, half a pixel off pixel 0."""
    return (pixels + 0.5) / scale - 0.5


def _as_grey(image: NDArray[np.uint8 | np.uint16]) -> NDArray[np.uint8 | np.uint16]:
    if image.ndim == 2:
        return image
    if image.shape[2] == 1:
        return image[:, :, 0]
    code = cv2.COLOR_BGR2GRAY if image.shape[2] == 3 else cv2.COLOR_BGRA2GRAY
    return np.asarray(cv2.cvtColor(image, code), dtype=image.dtype)


def _stretched(values: NDArray[np.uint8 | np.uint16], apart: int) -> NDArray[np.uint8]:
    """Map all but the darkest and the brightest half percent to 0...255, by pixels that are so many px `apart`."""
    dark, bright = np.percentile(values[::apart, ::apart], (0.5, 99.5))
    if dark == bright:
        dark, bright = values.min(), values.max()
    if dark == bright:
        raise DetectionError(
            f"every pixel has the grey value {dark:g}: is the lens covered or the light off?"
        )
    times = 255.0 / (bright - dark)
    # Less than 0 becomes 0, and more than 255 becomes 255.
    stretched = cv2.addWeighted(values, times, values, 0, -times * dark, dtype=cv2.CV_8U)
    return np.asarray(stretched, dtype=np.uint8)


def noise_of(values: NDArray[np.uint8 | np.uint16], apart: int) -> float:
    """Estimate the standard deviation of the grey values' noise, at least that of rounding to whole numbers.

    From the median response to a mask that is blind to planes and edges (Immerkær, Fast noise variance
    estimation, 1996), whose deviation is 6 times the noise's; looked at in places so many px `apart`.
    """
    height, width = (side - 2 for side in values.shape)
    response = np.zeros((-(-height // apart), -(-width // apart)), dtype=np.int32)
    for row, factors in enumerate(([1, -2, 1], [-2, 4, -2], [1, -2, 1])):
        for column, factor in enumerate(factors):
            part = values[row : row + height : apart, column : column + width : apart]
            response += factor * part.astype(np.int32)
    return max(float(np.median(np.abs(response))) / 0.6745 / 6, sqrt(1 / 12))
