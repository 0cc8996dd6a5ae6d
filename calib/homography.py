"""A first idea of a lens and of where it was, from a plane seen in several views. numpy alone, all views at once."""

import numpy as np
from numpy.typing import NDArray

from calib.errors import UnsolvableError
from calib.transforms import nearest_rotation, transform

Array = NDArray[np.float64]


def homographies(world: Array, pixels: Array, present: Array) -> Array:
    """Return the homographies (n, 3, 3) from the world's plane Z = 0 to pixels.

    `world` (n, q, 3) in m, `pixels` (n, q, 2), `present` (n, q) 1 or 0. The normalised direct linear transform.
    """
    flat, to_flat = _normalised(world[..., :2], present)
    seen, to_seen = _normalised(pixels, present)
    ones, zeros = present, np.zeros_like(present)
    x, y, u, v = flat[..., 0] * present, flat[..., 1] * present, seen[..., 0], seen[..., 1]
    rows = np.concatenate(
        [
            np.stack([x, y, ones, zeros, zeros, zeros, -u * x, -u * y, -u * ones], axis=-1),
            np.stack([zeros, zeros, zeros, x, y, ones, -v * x, -v * y, -v * ones], axis=-1),
        ],
        axis=1,
    )
    _, vectors = np.linalg.eigh(np.swapaxes(rows, 1, 2) @ rows)
    local = vectors[:, :, 0].reshape(-1, 3, 3)
    return np.asarray(np.linalg.inv(to_seen) @ local @ to_flat)


def first_focal_lengths(planes: Array, centre: Array) -> tuple[float, float]:
    """Return fx and fy in px of a lens with its principal point at `centre` (2,), seen from `planes` (n, 3, 3).

    Orthogonal directions of the plane stay orthogonal in space, and equal lengths equal (Zhang). Raises
    UnsolvableError where no view is tilted enough to tell.
    """
    shifted = np.array([[1, 0, -centre[0]], [0, 1, -centre[1]], [0, 0, 1]]) @ planes
    shifted = shifted / np.linalg.norm(shifted[:, :, :2], axis=(1, 2), keepdims=True)
    a, b = shifted[:, :, 0], shifted[:, :, 1]
    rows = np.concatenate([a * b, (a * a - b * b) / 2])
    scale = np.abs(centre).max()
    left = rows[:, :2] / scale**2
    square = np.linalg.lstsq(left, -rows[:, 2], rcond=None)[0]
    if not (square > 0).all():
        # Views tilted about one axis only tell one focal length.
        square = np.repeat(np.linalg.lstsq(left.sum(axis=1, keepdims=True), -rows[:, 2], rcond=None)[0], 2)
    if not (square > 0).all():
        raise UnsolvableError(
            "the views do not tell the focal length from the distance: "
            "take some with the target tilted by 20 degrees or more, or give known intrinsics"
        )
    fx, fy = scale / np.sqrt(square)
    return float(fx), float(fy)


def planar_poses(planes: Array, matrix: Array) -> Array:
    """Return world_from_camera (n, 4, 4) of views of the plane, given the camera matrix (3, 3)."""
    columns = np.linalg.solve(matrix, planes)
    # The target is in front of the camera.
    columns = columns * np.sign(columns[:, 2:, 2:])
    length = np.linalg.norm(columns[:, :, :2], axis=1).mean(axis=1)[:, None, None]
    columns = columns / length
    first, second = columns[:, :, 0], columns[:, :, 1]
    rotation = nearest_rotation(np.stack([first, second, np.cross(first, second)], axis=-1))
    back = np.swapaxes(rotation, 1, 2)
    return transform(back, -(back @ columns[:, :, 2:])[..., 0])


def _normalised(points: Array, present: Array) -> tuple[Array, Array]:
    """Return points (n, q, 2) about their mean with mean distance sqrt 2, and the transforms (n, 3, 3) that do it."""
    count = present.sum(axis=1)[:, None]
    mean = (points * present[..., None]).sum(axis=1) / count
    centred = points - mean[:, None]
    distance = (np.linalg.norm(centred, axis=-1) * present).sum(axis=1)[:, None] / count
    scale = np.sqrt(2) / np.maximum(distance, 1e-300)
    to = np.zeros((len(points), 3, 3))
    to[:, 0, 0] = to[:, 1, 1] = scale[:, 0]
    to[:, :2, 2] = -scale * mean
    to[:, 2, 2] = 1
    return centred * scale[..., None], to
