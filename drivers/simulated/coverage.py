"""How much of a pixel's square lies within an edge."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Offsets = NDArray[np.float32]

CORNERS: Offsets = np.array([[0, 0], [0.5, 0.5], [-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5]], np.float32)
"""Where in a pixel `share` wants the depth: the centre and the corners, opposite ones in pairs."""
_STRAIGHT = 0.15
"""Pixels by which an edge may bend within a pixel and still be taken for straight."""

_TINY = np.float32(1e-12)


def spread(count: int) -> Offsets:
    """Return places (count, 2) within a pixel, evenly spread: multiples of the plastic number's powers."""
    even = np.array([0.7548776662466927, 0.5698402909980532])
    return np.asarray(np.outer(np.arange(0.5, count), even) % 1.0 - 0.5, np.float32)


def share(depths: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Return each pixel's share (n,) that is within, from depths (n, 5) at `CORNERS`, and where to doubt it.

    Where the edge is straight the share is exact: the area of a square that a straight line cuts off. Corners
    and tight bends are in doubt: there the pixel has to be sampled.
    """
    centre, lower_right, upper_left, upper_right, lower_left = depths.T
    slope_u = (lower_right + upper_right - upper_left - lower_left) / 2
    slope_v = (lower_right + lower_left - upper_left - upper_right) / 2
    slope = np.maximum(np.hypot(slope_u, slope_v), _TINY)
    distance = centre / slope
    bend = np.maximum(abs(lower_right + upper_left - 2 * centre), abs(upper_right + lower_left - 2 * centre))
    reach = np.max(np.abs(depths[:, 1:] - centre[:, None]), axis=1)
    doubtful = (np.abs(centre) <= 1.05 * reach) & (bend > _STRAIGHT * slope)
    return _area(distance, np.abs(slope_u) / slope, np.abs(slope_v) / slope), doubtful


def _area(distance: Floats, a: Floats, b: Floats) -> Floats:
    """Return the area (n,) of the unit square on the inner side of lines at `distance` from its centre.

    (a, b) are the absolute components of the lines' unit normals.
    """
    far, near = (a + b) / 2, np.abs(a - b) / 2  # distances of the square's corners from its centre
    inner = np.minimum(np.abs(distance), far)
    band = 0.5 + inner / np.maximum(np.maximum(a, b), _TINY)
    corner = 1.0 - (far - inner) ** 2 / np.maximum(2 * a * b, _TINY)
    area = np.where(inner >= far, 1.0, np.where(inner <= near, band, corner))
    return np.where(distance >= 0, area, 1 - area).astype(np.float32)
