"""A pixel with its derivatives by the point and by the lens, for whole arrays of points."""

import numpy as np
from numpy.typing import NDArray

from calib.session import Intrinsics

Array = NDArray[np.float64]


def lens_vector(lens: Intrinsics) -> Array:
    """Return the lens's parameters in the order of `LENS_NAMES`."""
    return np.array([*lens.numbers().values()], dtype=float)


def lens_from_vector(values: Array, like: Intrinsics) -> Intrinsics:
    """Return a lens of the model and picture size of `like` with other parameters."""
    fx, fy, cx, cy, *distortion = (float(value) for value in values)
    return like.model_copy(update={"fx": fx, "fy": fy, "cx": cx, "cy": cy, "distortion": distortion})


def pixel_terms(points: Array, values: Array, model: str) -> tuple[Array, Array, Array]:
    """Return pixels (2, ...), and their derivatives by the points (2, 3, ...) and by the lens (2, L, ...).

    `points` (3, ...) are in the camera's frame (m), `values` (L,) as of `lens_vector`. Points that the lens
    cannot see give NaN. Coordinates come first, so that each is an array of its own.
    """
    depth = np.where(points[2] > 0, points[2], np.nan)
    x, y = points[0] / depth, points[1] / depth
    fx, fy, cx, cy = values[:4]
    by_lens = np.zeros((2, len(values), *x.shape))
    if model == "opencv":
        (u, v), (uu, uv, vu, vv) = _opencv(x, y, values[4:], bend=by_lens[:, 4:])
    else:
        (u, v), (uu, uv, vu, vv) = _division(x, y, values[4], bend=by_lens[:, 4:])
    by_lens[:, 4:] *= np.reshape([fx, fy], (2, *[1] * (x.ndim + 1)))
    by_lens[0, 0], by_lens[1, 1] = u, v
    by_lens[0, 2] = by_lens[1, 3] = 1
    by_point = np.empty((2, 3, *x.shape))
    across, down = fx / depth, fy / depth
    by_point[0, 0], by_point[0, 1] = across * uu, across * uv
    by_point[1, 0], by_point[1, 1] = down * vu, down * vv
    by_point[:, 2] = -(by_point[:, 0] * x + by_point[:, 1] * y)
    return np.stack([fx * u + cx, fy * v + cy]), by_point, by_lens


Pair = tuple[Array, Array]
Four = tuple[Array, Array, Array, Array]


def _opencv(x: Array, y: Array, distortion: Array, bend: Array) -> tuple[Pair, Four]:
    """Return the distorted point and its derivatives by x and y; those by the distortion go into `bend` (2, 5, ...)."""
    k1, k2, p1, p2, k3 = distortion
    xx, yy, xy = x * x, y * y, x * y
    r2 = xx + yy
    r4 = r2 * r2
    radial = 1 + k1 * r2 + r4 * (k2 + k3 * r2)
    slope = 2 * k1 + 4 * k2 * r2 + 6 * k3 * r4
    first, second, third = 2 * xy, r2 + 2 * yy, r2 + 2 * xx
    u = x * radial + p1 * first + p2 * third
    v = y * radial + p1 * second + p2 * first
    cross = slope * xy + 2 * (p1 * x + p2 * y)
    jacobian = (
        radial + slope * xx + 2 * p1 * y + 6 * p2 * x,
        cross,
        cross,
        radial + slope * yy + 6 * p1 * y + 2 * p2 * x,
    )
    for column, factor in ((0, r2), (1, r4), (4, r4 * r2)):
        bend[0, column], bend[1, column] = x * factor, y * factor
    bend[0, 2], bend[1, 2] = first, second
    bend[0, 3], bend[1, 3] = third, first
    return (u, v), jacobian


def _division(x: Array, y: Array, k1: float, bend: Array) -> tuple[Pair, Four]:
    """Return the same for the division model, whose `bend` is (2, 1, ...)."""
    r2 = x * x + y * y
    under = 1 - 4 * k1 * r2
    root = np.sqrt(np.where(under > 0, under, np.nan))
    factor = 2 / (1 + root)
    # d factor / d (k1 r2) = factor^2 / root: the one slope from which the others follow.
    slope = factor**2 / root
    radial = 2 * k1 * slope
    cross = radial * x * y
    jacobian = (factor + radial * x * x, cross, cross, factor + radial * y * y)
    bend[0, 0], bend[1, 0] = x * slope * r2, y * slope * r2
    return (x * factor, y * factor), jacobian
