"""Corners of squares from a few of the pixels along their edges: where they are is known already."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib.detection.corners import UNMODELLED_VARIANCE, Crossings, light_at, saddle
from calib.detection.edge_profile import FIRST_BLUR, LEAST_BLUR
from calib.detection.grey_fit import fit_grey_values
from calib.detection.picture import Picture
from calib.detection.strips import Floats, Patches

APART = 1.42  # px; two places further apart than a pixel's diagonal are never in the same one
ACROSS = APART * np.arange(-3, 4)  # px from the edge
ALONG = np.array([-1.0, -0.8, -0.6, -0.4, -0.2, 0.2, 0.4, 0.6, 0.8, 1.0])  # of what is free of other corners
CLEAR_OF_BLUR = 1.5  # px
STANDS_STILL = 0.1  # px; the next step would be less than such points scatter


class SparseCorners(NamedTuple):
    """Corners' `pixels` (n, 2), their `covariances` (n, 2, 2) in px², and what the fits say of them.

    `steps` (n,) are half of the difference in grey value from squares to squares, `left` (n,) the standard deviation of
    the grey values from the fit; `good` (n,) tells which fits came to an end.
    """

    pixels: Floats
    covariances: Floats
    steps: Floats
    left: Floats
    good: NDArray[np.bool_]


def sparse_corners(
    values: NDArray[np.uint8 | np.uint16], noise: float, crossings: Crossings, paper: Floats
) -> SparseCorners:
    """Measure corners in grey values (h, w) that have such a noise, and are `paper` (n,) in white squares."""
    patches = _patches(values, crossings)
    n = len(paper)
    start = np.column_stack([np.zeros((n, 2)), np.full(n, np.log(FIRST_BLUR))])
    least = np.array([-np.inf, -np.inf, np.log(LEAST_BLUR)])
    heights = crossings.heights(patches.x, patches.y)
    shape = partial(saddle, crossings.directions.astype(np.float32), heights)
    everywhere = np.ones(n, dtype=bool)
    light = light_at(
        crossings.pixels, np.log(np.maximum(paper, 1)), everywhere, float(np.median(crossings.lengths))
    )
    # Nothing of the picture is looked at but the patches.
    seen = Picture(np.empty((0, 0), np.uint8), patches.values, noise)
    fit = fit_grey_values(seen, patches, shape, start, least, light, STANDS_STILL)
    return SparseCorners(
        crossings.pixels + fit.parameters[:, :2],
        fit.covariances[:, :2, :2] + UNMODELLED_VARIANCE * np.eye(2),
        fit.steps,
        fit.scatters,
        fit.converged,
    )


def _patches(values: NDArray[np.uint8 | np.uint16], crossings: Crossings) -> Patches:
    """Take the pixels nearest to places along both edges of each corner, and across."""
    n, (height, width) = len(crossings.pixels), values.shape
    along = crossings.lengths[:, :, None, None] * ALONG[:, None]
    unit_x, unit_y = (crossings.directions[:, :, axis, None, None] for axis in (0, 1))
    x, y = crossings.pixels[:, 0, None, None, None], crossings.pixels[:, 1, None, None, None]
    column = np.rint(x + along * unit_x - ACROSS * unit_y).astype(np.int32)
    row = np.rint(y + along * unit_y + ACROSS * unit_x).astype(np.int32)
    used = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    used &= np.abs(ACROSS) < np.maximum(crossings.clear - CLEAR_OF_BLUR, APART + 0.1)[:, None, None, None]
    taken = np.take(values, row * width + column, mode="clip")
    return Patches(*(part.astype(np.float32).reshape(n, -1) for part in (column - x, row - y, taken, used)))
