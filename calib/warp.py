"""A plate is never flat: low-order shapes of how far a target's points lie out of its mean plane. numpy alone."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

QUADRATIC = ("xx", "xy", "yy")
CUBIC = ("xxx", "xxy", "xyy", "yyy")


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


def possible_shapes(points: Array, shapes: Sequence[str]) -> tuple[str, ...]:
    """Return those of `shapes` that targets with these `points` (t, 3) can tell: across two columns none is curved."""
    distinct = [len(np.unique(points[:, axis].round(9))) for axis in range(2)]
    return tuple(s for s in shapes if s.count("x") < distinct[0] and s.count("y") < distinct[1])
