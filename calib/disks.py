"""Where a disk is seen: the centroid of its picture, which is not the picture of its centre.

A tilted disk's nearer half looks larger, and the lens bends it besides. The solver's residual adds this
offset to the predicted centre, here and nowhere else; detectors report centroids as they are.
"""

import numpy as np
from numpy.typing import NDArray

from calib.lens import project_points
from calib.session import Intrinsics

Array = NDArray[np.float64]

RIM_POINTS = 16
"""Points on the rim; the picture of a circle is so smooth that sixteen give its area to rounding."""


def centroid_offsets(centres: Array, camera_from_world: Array, diameter: float, lens: Intrinsics) -> Array:
    """Return the centroid of each disk's picture less the picture of its centre (..., q, 2) in px.

    `centres` (..., q, 3) lie in planes parallel to the world's Z = 0 (m), `camera_from_world` is (..., 4, 4),
    `diameter` in m.
    """
    angles = 2 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
    rim = diameter / 2 * np.column_stack([np.cos(angles), np.sin(angles)])
    rotation, translation = camera_from_world[..., None, :3, :3], camera_from_world[..., None, :3, 3]
    placed = (rotation @ centres[..., None])[..., 0] + translation
    across = rim @ np.swapaxes(camera_from_world[..., :3, :2], -1, -2)
    middle = project_points(placed, lens)
    seen = project_points(placed[..., None, :] + across[..., None, :, :], lens) - middle[..., None, :]
    # Green's theorem over the rim; derivatives by the sampled rim's own Fourier series.
    slope = FOURIER_DERIVATIVE @ seen
    x, y, dx, dy = seen[..., 0], seen[..., 1], slope[..., 0], slope[..., 1]
    area = (x * dy - y * dx).sum(axis=-1)
    moments = np.stack([(x * x * dy).sum(axis=-1), -(y * y * dx).sum(axis=-1)], axis=-1)
    return np.asarray(moments / area[..., None])


def _fourier_derivative(count: int) -> Array:
    """Return the matrix that differentiates `count` (even) samples of a periodic function of period 2 pi."""
    step = np.subtract.outer(np.arange(count), np.arange(count))
    with np.errstate(divide="ignore"):
        matrix = 0.5 * (-1.0) ** step / np.tan(np.pi * step / count)
    np.fill_diagonal(matrix, 0.0)
    return np.asarray(matrix)


FOURIER_DERIVATIVE = _fourier_derivative(RIM_POINTS)
