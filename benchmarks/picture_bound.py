"""How well a picture can tell where its points are: the Cramer-Rao bound of a place."""

from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.rendered_plates import SeenPlate
from benchmarks.true_rig import Array

SHIFT: Final = 0.05
"""Pixels to each side, for the derivatives of grey values by places."""
ROUNDING: Final = 1 / 12
"""Variance of grey values that are rounded to whole numbers."""


def place_bounds(plate: SeenPlate, reach: float) -> Array:
    """Return the least covariances (n, 2, 2) in px² that unbiased places of the plate's points can have.

    Each point is told from the pixels up to `reach` px away from it that are nearest to it. All else that the
    grey values depend on is taken for known, so that a detector that has to find out more is further off.
    """
    points = plate.points()
    by_x, by_y = (
        (plate.light(shift) - plate.light((-shift[0], -shift[1]))) / (2 * SHIFT)
        for shift in ((SHIFT, 0.0), (0.0, SHIFT))
    )
    rows, columns = np.nonzero((by_x != 0) | (by_y != 0))
    away, nearest = cKDTree(points).query(np.column_stack([columns, rows]), distance_upper_bound=reach)
    rows, columns, nearest = (each[np.isfinite(away)] for each in (rows, columns, nearest))
    slopes = np.stack([by_x[rows, columns], by_y[rows, columns]]).astype(float)
    information = np.empty((len(points), 2, 2))
    for i in (0, 1):
        for j in (0, 1):
            information[:, i, j] = np.bincount(nearest, slopes[i] * slopes[j], minlength=len(points))
    return (plate.scene.noise**2 + ROUNDING) * np.linalg.inv(information)
