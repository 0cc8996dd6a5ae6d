"""Which of a grid's possible readings is the target's: never a mirror image, and always the same way up."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.targets import Target, target_symmetries


def is_mirrored(grid: NDArray[np.float64]) -> bool:
    """Tell whether a grid of pixels (rows, columns, 2) would put Z = X x Y towards the camera.

    The printed side faces the camera and pixel y points down, so that the outline from the first point along
    the columns and then along the rows has a positive area.
    """
    outline = grid[[0, 0, -1, -1], [0, -1, -1, 0]]
    following = np.roll(outline, -1, axis=0)
    return bool(np.sum(outline[:, 0] * following[:, 1] - outline[:, 1] * following[:, 0]) < 0)


def upright(target: Target, pixels: NDArray[np.float64]) -> NDArray[np.int64]:
    """Choose the reading whose point 0 is nearest to the picture's top left corner, pixel (0, 0).

    `pixels` (n, 2) are one reading of the whole target, by id; the result (n,) is a permutation: the chosen
    reading is `pixels[permutation]`. A target without symmetries is left as it is.
    """
    readings = [np.arange(len(pixels)), *(symmetry.permutation for symmetry in target_symmetries(target))]
    return min(readings, key=lambda reading: float(np.hypot(*pixels[reading[0]])))
