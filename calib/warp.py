"""A plate is never flat: low-order shapes of how far a target's points lie out of its mean plane. numpy alone."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SECOND = ("xx", "xy", "yy")
THIRD = ("xxx", "xxy", "xyy", "yyy")
FOURTH = ("xxxx", "xxxy", "xxyy", "xyyy", "yyyy")
"""A sheet held along its edges needs it: a dome is 1 - xx - yy + xxyy."""
WARPS = (SECOND, SECOND + THIRD, SECOND + FOURTH, SECOND + THIRD + FOURTH)


def warp_shapes(points: Array, shapes: Sequence[str]) -> Array:
    """Return the heights (t, w) of unit shapes at the target's `points` (t, 3).

    A shape such as `xxy` is that product of the coordinates over the plate, each from -1 to 1, without its
    best-fitting plane, and at most 1 high: its coefficient is a height in metres.
    """
    if not len(points) or not shapes:
        return np.zeros((len(points), len(shapes)))
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    unit = (2 * points[:, :2] - low - high) / np.where(high > low, high - low, 1.0)
    place = {"x": unit[:, 0], "y": unit[:, 1]}
    products = np.column_stack([np.prod([place[letter] for letter in shape], axis=0) for shape in shapes])
    plane = np.column_stack([np.ones(len(unit)), unit])
    curved = products - plane @ np.linalg.lstsq(plane, products, rcond=None)[0]
    return np.asarray(curved / np.abs(curved).max(axis=0))


def possible_warps(points: Array) -> list[tuple[str, ...]]:
    """Return the sets of shapes that may be tried on a target with these `points` (t, 3), the largest last.

    Across two columns nothing is curved, and across three nothing is curved twice.
    """
    distinct = [len(np.unique(points[:, axis].round(9))) for axis in range(2)]
    told = [
        tuple(shape for shape in shapes if shape.count("x") < distinct[0] and shape.count("y") < distinct[1])
        for shapes in WARPS
    ]
    return [shapes for shapes in dict.fromkeys(told) if shapes]
