"""The camera's lens: from a point in front of it to a pixel, and back. numpy alone.

Camera axes are x right, y down, z forward. `opencv` has the distortion k1 k2 p1 p2 k3 of OpenCV, `division`
the one-parameter model of eq 19 and 20, `undistorted = distorted / (1 + k1 r_distorted^2)`, on normalised
coordinates.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.session import Intrinsics

Array = NDArray[np.float64]

NEWTON_STEPS = 25
CONVERGED = 1e-10


def project_points(points: ArrayLike, lens: Intrinsics) -> Array:
    """Return the pixels (..., 2) of `points` (..., 3) in the camera's frame (m).

    NaN for points not in front of the camera, or outside the cone for which the lens model holds.
    """
    return np.stack(project_coordinates(np.moveaxis(np.asarray(points, dtype=float), -1, 0), lens), axis=-1)


def project_coordinates(points: Array, lens: Intrinsics) -> tuple[Array, Array]:
    """Return both coordinates (...) of the same pixels, of points (3, ...): far faster than pairs and triples."""
    x, y, z = points
    depth = np.where(z > 0, z, np.nan)
    u, v = _distorted(x / depth, y / depth, lens)
    return lens.fx * u + lens.cx, lens.fy * v + lens.cy


def pixel_rays(pixels: ArrayLike, lens: Intrinsics) -> Array:
    """Return unit vectors (..., 3) in the camera's frame along which `pixels` (..., 2) look; else NaN."""
    flat = undistort(pixels_to_normalised(pixels, lens), lens)
    rays = np.concatenate([flat, np.ones((*flat.shape[:-1], 1))], axis=-1)
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True), dtype=float)


def camera_matrix(lens: Intrinsics) -> Array:
    """Return K (3, 3)."""
    return np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])


def pixels_to_normalised(pixels: ArrayLike, lens: Intrinsics) -> Array:
    """Return the distorted normalised coordinates (..., 2) of `pixels`."""
    return np.asarray((np.asarray(pixels, dtype=float) - [lens.cx, lens.cy]) / [lens.fx, lens.fy])


def distort(flat: Array, lens: Intrinsics) -> Array:
    """Return distorted normalised coordinates (..., 2) of undistorted ones; NaN where the model ends."""
    return np.stack(_distorted(flat[..., 0], flat[..., 1], lens), axis=-1)


def undistort(distorted: Array, lens: Intrinsics) -> Array:
    """Return undistorted normalised coordinates (..., 2) of distorted ones; NaN where none leads there."""
    if lens.model == "division":
        growth = 1 + lens.distortion[0] * (distorted**2).sum(axis=-1, keepdims=True)
        return np.asarray(distorted / np.where(growth > 0, growth, np.nan))
    flat = distorted.copy()
    for _ in range(NEWTON_STEPS):
        miss = distort(flat, lens) - distorted
        if not np.nanmax(np.abs(miss), initial=0) > CONVERGED / 1000:
            break
        flat = flat - np.linalg.solve(_jacobian_opencv(flat, lens.distortion), miss[..., None])[..., 0]
    miss = np.abs(distort(flat, lens) - distorted).max(axis=-1, keepdims=True)
    return np.where(miss <= CONVERGED, flat, np.nan)


def _distorted(x: Array, y: Array, lens: Intrinsics) -> tuple[Array, Array]:
    """Return distorted coordinates (...) of undistorted ones."""
    square = x * x + y * y
    if lens.model == "division":
        under = 1 - 4 * lens.distortion[0] * square
        growth = 2 / (1 + np.sqrt(np.where(under > 0, under, np.nan)))
        return x * growth, y * growth
    k1, k2, p1, p2, k3 = lens.distortion
    radial = 1 + square * (k1 + square * (k2 + square * k3))
    cross = 2 * x * y
    u = x * radial + p1 * cross + p2 * (square + 2 * x * x)
    v = y * radial + p2 * cross + p1 * (square + 2 * y * y)
    return u, v


def _jacobian_opencv(flat: Array, distortion: list[float]) -> Array:
    """Return d distorted / d undistorted (..., 2, 2)."""
    k1, k2, p1, p2, k3 = distortion
    x, y = flat[..., 0], flat[..., 1]
    square = x**2 + y**2
    radial = 1 + square * (k1 + square * (k2 + square * k3))
    slope = 2 * (k1 + square * (2 * k2 + square * 3 * k3))
    jacobian = np.empty((*flat.shape[:-1], 2, 2))
    jacobian[..., 0, 0] = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
    jacobian[..., 1, 1] = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
    jacobian[..., 0, 1] = jacobian[..., 1, 0] = slope * x * y + 2 * p1 * x + 2 * p2 * y
    return jacobian
