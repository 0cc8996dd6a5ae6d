"""The part of a picture in which a target is expected."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from calib.detection.picture import grey_values, noise_of
from calib.detection.places import Places
from calib.errors import DetectionError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SMALLEST = 8  # px
NOISE_SAMPLES = 2_500
CLEAR_OF_NOISE = 4.0  # times the noise: less is no contrast


@dataclass(frozen=True, eq=False)
class Window:
    """The part of a picture that holds all places: grey `values` (h, w), and where its top left pixel is."""

    values: NDArray[np.uint8 | np.uint16]
    left: int
    top: int
    noise: float

    def at(self, pixels: Array) -> NDArray[np.float32]:
        """Give the values (...) nearest to pixels (..., 2), for all that are out of the window those at its border."""
        height, width = self.values.shape
        x = np.rint(np.clip(pixels[..., 0], 0, width - 1)).astype(np.int32)
        y = np.rint(np.clip(pixels[..., 1], 0, height - 1)).astype(np.int32)
        return np.asarray(np.take(self.values, y * width + x), dtype=np.float32)

    def holds(self, pixels: Array) -> Mask:
        """Tell for which rows all pixels (m, k, 2) are in the window."""
        height, width = self.values.shape
        x, y = pixels[..., 0], pixels[..., 1]
        return np.asarray(((x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)).all(axis=1))


def window_on(image: NDArray[np.generic], places: Places, off: float) -> Window:
    """Take the part of a picture in which places are that may be off by so many px.

    Raises DetectionError where hardly one of the places can be in it.
    """
    (left, right), (top, bottom) = (
        np.clip([np.floor(at.min() - off), np.ceil(at.max() + off) + 1], 0, size).astype(int).tolist()
        for at, size in zip(places.listed.T, image.shape[1::-1], strict=True)
    )
    if min(right - left, bottom - top) < SMALLEST:
        raise DetectionError("the target is predicted to be out of the picture")
    part = slice(top, bottom), slice(left, right)
    apart = max(round(sqrt((bottom - top) * (right - left) / NOISE_SAMPLES)), 1)
    if image.ndim == 2:
        values = grey_values(image)
        return Window(values, 0, 0, noise_of(values[part], apart))
    values = grey_values(image, part)
    return Window(values, left, top, noise_of(values, apart))
