"""The pixels along straight edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.detection.picture import Picture

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Patches:
    """The m pixels that each of n pieces is fitted to, as `x` and `y` (n, m) in px from the piece's origin.

    `values` (n, m) are their grey values; those with `used` (n, m) 0 fill up the rows and count for nothing.
    """

    x: Singles
    y: Singles
    values: Singles
    used: Singles


def strips(picture: Picture, origins: Floats, starts: Floats, ends: Floats, width: float) -> Patches:
    """Give the pixels within `width` px of each edge, from starts to ends (n, 2) in px from origins (n, 2).

    They are whole lines of pixels, along x or y, whichever crosses the edge more steeply: nothing is
    interpolated, and each pixel comes once. Pixels out of the picture do not count.
    """
    direction = ends - starts
    steep = np.abs(direction[:, 1]) > np.abs(direction[:, 0])
    # Steep edges are treated as lying ones, with x and y exchanged.
    first, last, origin, size = (
        np.where(steep[:, None], places[:, ::-1], places)
        for places in (starts + origins, ends + origins, origins, np.array([picture.values.shape[::-1]]))
    )
    first, last = (np.where(first[:, :1] <= last[:, :1], *pair) for pair in ((first, last), (last, first)))
    slope = (last[:, 1:] - first[:, 1:]) / np.maximum(last[:, :1] - first[:, :1], 1e-9)
    reach = width * np.sqrt(1 + slope**2)

    beginning, end = np.maximum(np.ceil(first[:, :1]), 0), np.minimum(np.floor(last[:, :1]), size[:, :1] - 1)
    along = beginning + np.arange(int((end - beginning).max(initial=0.0)) + 1)
    middle = first[:, 1:] + slope * (along - first[:, :1])
    lowest = np.maximum(np.ceil(middle - reach), 0)
    highest = np.minimum(np.floor(middle + reach), size[:, 1:] - 1)
    counts = np.where(along <= end, highest - lowest + 1, 0).astype(np.intp)
    across = np.arange(int(np.floor(2 * reach.max(initial=0.0))) + 1)

    used = across < counts[..., None]
    row = picture.values.shape[1]
    ahead, aside = np.where(steep, row, 1)[:, None], np.where(steep, 1, row)[:, None]
    nearest = (along * ahead + lowest * aside).astype(np.intp)
    values = np.take(picture.values, nearest[..., None] + across * aside[..., None], mode="clip")
    off_along, off_across = (along - origin[:, :1]), (lowest - origin[:, 1:])
    x, y = (
        np.where(which[:, None], off_across, off_along).astype(np.float32)[..., None]
        + (which[:, None] * across).astype(np.float32)[:, None]
        for which in (steep, ~steep)
    )
    return Patches(
        *(each.astype(np.float32, copy=False).reshape(len(starts), -1) for each in (x, y, values, used))
    )
