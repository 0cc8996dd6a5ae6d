"""Rigid transforms as 4 x 4 matrices: `p_a = a_from_b @ p_b`."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def transform(rotation: ArrayLike, translation: ArrayLike) -> Array:
    """Return transforms (..., 4, 4) of rotations (..., 3, 3) and translations (..., 3) (eq 1, corrected)."""
    rotation, translation = np.asarray(rotation, dtype=float), np.asarray(translation, dtype=float)
    result = np.zeros((*np.broadcast_shapes(rotation.shape[:-2], translation.shape[:-1]), 4, 4))
    result[..., :3, :3] = rotation
    result[..., :3, 3] = translation
    result[..., 3, 3] = 1
    return result


def inverse(matrix: Array) -> Array:
    """Return b_from_a (..., 4, 4) for a_from_b (eq 8, corrected)."""
    rotation = np.swapaxes(matrix[..., :3, :3], -1, -2)
    return transform(rotation, -(rotation @ matrix[..., :3, 3:])[..., 0])


def rotation_log(matrix: Array) -> Array:
    """Return the rotation vectors (n, 3) in rad of rotations (n, 3, 3) or transforms (n, 4, 4)."""
    # scipy is a third of the daemon's start, and a pose does not need it.
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(matrix[..., :3, :3]).as_rotvec(), dtype=float)


def nearest_rotation(matrix: Array) -> Array:
    """Return the rotations nearest to `matrix` (..., 3, 3) in the chordal sense."""
    u, _, vt = np.linalg.svd(matrix)
    sign = np.ones((*matrix.shape[:-2], 3))
    sign[..., 2] = np.sign(np.linalg.det(u @ vt))
    return np.asarray((u * sign[..., None, :]) @ vt)


def rigid(rows: ArrayLike) -> Array:
    """Return `rows` (..., 4, 4) with their rotations made exact: files carry them rounded."""
    matrix = np.asarray(rows, dtype=float)
    return transform(nearest_rotation(matrix[..., :3, :3]), matrix[..., :3, 3])


def mean_transform(matrices: Array) -> Array:
    """Return the mean (4, 4) of `matrices` (n, 4, 4): chordal for the rotation, plain for the position."""
    return transform(nearest_rotation(matrices[:, :3, :3].mean(axis=0)), matrices[:, :3, 3].mean(axis=0))


def pose_error(a: Array, b: Array) -> tuple[Array, Array]:
    """Return the distances (n,) in m and the angles (n,) in rad between the poses `a` and `b` (n, 4, 4)."""
    distance = np.linalg.norm(a[..., :3, 3] - b[..., :3, 3], axis=-1)
    return distance, np.linalg.norm(
        rotation_log(np.swapaxes(a[..., :3, :3], -1, -2) @ b[..., :3, :3]), axis=-1
    )


def any_normal(
    axis: Array, preferred: ArrayLike = (1.0, 0.0, 0.0), other: ArrayLike = (0.0, 1.0, 0.0)
) -> Array:
    """Return `preferred` made normal to the unit vector `axis` (3,), or `other` where that is degenerate."""
    for candidate in (np.asarray(preferred, dtype=float), np.asarray(other, dtype=float)):
        normal = candidate - (candidate @ axis) * axis
        length = np.linalg.norm(normal)
        if length > 0.1 * np.linalg.norm(candidate):
            return normal / length
    raise ValueError("both directions are parallel to the axis")
