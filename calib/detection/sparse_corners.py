"""Corners of squares from a few of the pixels along their edges: where they are is known already."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib.detection.crossings import UNMODELLED_VARIANCE, Crossings, fit_crossings
from calib.detection.edge_profile import FIRST_BLUR
from calib.detection.grey_fit import Light
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


def sparse_corners(picture: Picture, crossings: Crossings, paper: Floats) -> SparseCorners:
    """Measure corners that are known to a pixel or so, and are `paper` (n,) in white squares."""
    n, patches = len(paper), _patches(picture, crossings)
    apart = float(np.median(crossings.lengths))
    light = Light.followed(crossings.pixels, np.log(np.maximum(paper, 1)), np.ones(n, dtype=bool), apart)
    heights = crossings.heights(patches.x, patches.y)
    # Of the picture's extremes, those of the patches tell as much.
    seen = replace(picture, values=patches.values)
    fit = fit_crossings(seen, crossings, patches, heights, np.full(n, FIRST_BLUR), light, STANDS_STILL)
    return SparseCorners(
        crossings.pixels + fit.parameters[:, :2],
        fit.covariances[:, :2, :2] + UNMODELLED_VARIANCE * np.eye(2),
        fit.steps,
        fit.scatters,
        fit.converged,
    )


def _patches(picture: Picture, crossings: Crossings) -> Patches:
    """Take the pixels nearest to places along both edges of each corner, and across."""
    n, (height, width) = len(crossings.pixels), picture.values.shape
    along = crossings.lengths[:, :, None, None] * ALONG[:, None]
    unit_x, unit_y = (crossings.directions[:, :, axis, None, None] for axis in (0, 1))
    x, y = crossings.pixels[:, 0, None, None, None], crossings.pixels[:, 1, None, None, None]
    column = np.rint(x + along * unit_x - ACROSS * unit_y).astype(np.int32)
    row = np.rint(y + along * unit_y + ACROSS * unit_x).astype(np.int32)
    used = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    used &= np.abs(ACROSS) < np.maximum(crossings.clear - CLEAR_OF_BLUR, APART + 0.1)[:, None, None, None]
    taken = np.take(picture.values, row * width + column, mode="clip")
    return Patches(*(part.astype(np.float32).reshape(n, -1) for part in (column - x, row - y, taken, used)))
