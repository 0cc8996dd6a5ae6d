"""Where a disk is seen: the centroid of its picture, which is not the picture of its centre.

A tilted disk's nearer half looks larger, and the lens bends it besides. The solver's residual adds this
offset to the predicted centre, here and nowhere else; detectors report centroids as they are.
"""

import numpy as np
from numpy.typing import NDArray

from calib.lens import project_coordinates
from calib.session import Intrinsics

Array = NDArray[np.float64]

RIM_POINTS = 8
"""Points on the rim: a circle's picture is so smooth that eight give its centroid to 1e-6 px.

That is for a disk a tenth of its distance across; for smaller ones it is far better.
"""


def centroid_offsets(centres: Array, camera_from_world: Array, diameter: float, lens: Intrinsics) -> Array:
    """Return the centroid of each disk's picture less the picture of its centre (..., q, 2) in px.

    `centres` (..., q, 3) lie in planes parallel to the world's Z = 0 (m), `camera_from_world` is (..., 4, 4),
    `diameter` in m.
    """
    angles = 2 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
    rotation, translation = camera_from_world[..., :3, :3], camera_from_world[..., :3, 3:]
    placed = rotation @ np.swapaxes(centres, -1, -2) + translation
    across = diameter / 2 * rotation[..., :2] @ np.stack([np.cos(angles), np.sin(angles)])
    middle = _seen(placed, lens)
    seen = [_seen(placed + across[..., k : k + 1], lens) - middle for k in range(RIM_POINTS)]
    x, y = np.stack(seen, axis=1)
    # Green's theorem over the rim; derivatives by the sampled rim's own Fourier series.
    dx, dy = np.tensordot(FOURIER_DERIVATIVE, x, 1), np.tensordot(FOURIER_DERIVATIVE, y, 1)
    area = 2 * np.einsum("k...,k...->...", x, dy)
    moments = [np.einsum("k...,k...,k...->...", x, x, dy), -np.einsum("k...,k...,k...->...", y, y, dx)]
    return np.asarray(np.stack(moments, axis=-1) / area[..., None])


def _seen(points: Array, lens: Intrinsics) -> Array:
    """Return the pixels (2, ..., q) of points (..., 3, q) in the camera's frame."""
    return np.stack(project_coordinates(np.moveaxis(points, -2, 0), lens))


def _fourier_derivative(count: int) -> Array:
    """Return the matrix that differentiates `count` (even) samples of a periodic function of period 2 pi."""
    step = np.subtract.outer(np.arange(count), np.arange(count))
    with np.errstate(divide="ignore"):
        matrix = 0.5 * (-1.0) ** step / np.tan(np.pi * step / count)
    np.fill_diagonal(matrix, 0.0)
    return np.asarray(matrix)


FOURIER_DERIVATIVE = _fourier_derivative(RIM_POINTS)
