"""The camera's pose from one view of the target, given its lens."""

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.errors import UnsolvableError
from calib.lens import pixels_to_normalised, project_points, undistort
from calib.session import Intrinsics
from calib.transforms import inverse, transform

Array = NDArray[np.float64]

NEARLY_FLAT = 0.02
"""How far points may lie out of a plane, over its size, to be taken for it first."""


def pose_from_view(world: ArrayLike, pixels: ArrayLike, lens: Intrinsics) -> Array:
    """Return world_from_camera (4, 4) that best explains points `world` (n, 3) in m seen at `pixels` (n, 2).

    Of the two poses that a plane nearly allows the one with the smaller reprojection error is taken. Raises
    UnsolvableError for fewer than four points, or points in a line.
    """
    world, pixels = np.asarray(world, dtype=float), np.asarray(pixels, dtype=float)
    spread = np.linalg.svd(world - world.mean(axis=0), compute_uv=False) if len(world) else np.zeros(3)
    if len(world) < 4 or spread[1] < 1e-6 * spread[0]:
        raise UnsolvableError(
            f"a camera's pose needs four points that are not in a line; {len(world)} are seen"
        )
    flat = undistort(pixels_to_normalised(pixels, lens), lens)
    if not np.isfinite(flat).all():
        raise UnsolvableError(
            "points are seen where the lens model does not reach: are the intrinsics right?"
        )
    candidates = [_refined(world, flat, guess) for guess in _guesses(world, flat)]
    errors = [_reprojection(world, pixels, lens, candidate) for candidate in candidates]
    return inverse(candidates[int(np.argmin(errors))])


def _guesses(world: Array, flat: Array) -> list[tuple[Array, Array]]:
    # A plate that bulges has the two poses of a plane, from which each is refined with the bulge.
    nearly_flat = np.abs(world[:, 2]).max() <= NEARLY_FLAT * np.ptp(world[:, :2])
    guesses = _posed(world * [1, 1, 0], flat, cv2.SOLVEPNP_IPPE) if nearly_flat else []
    # Where a plane's middle is seen right ahead, OpenCV has no numbers for them, or wrong ones.
    guesses += _posed(world, flat, cv2.SOLVEPNP_SQPNP)
    if not guesses:
        raise UnsolvableError(
            "no camera pose explains where the target's points are seen: are their ids right?"
        )
    return guesses


def _posed(world: Array, flat: Array, method: int) -> list[tuple[Array, Array]]:
    _, rotations, translations, _ = cv2.solvePnPGeneric(world, flat, np.eye(3), None, flags=method)
    poses = [
        (np.asarray(r, dtype=float), np.asarray(t, dtype=float))
        for r, t in zip(rotations, translations, strict=True)
    ]
    return [(r, t) for r, t in poses if np.isfinite(r).all() and np.isfinite(t).all()]


def _refined(world: Array, flat: Array, guess: tuple[Array, Array]) -> Array:
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 1e-14)
    rotation, translation = cv2.solvePnPRefineLM(world, flat, np.eye(3), None, *guess, criteria)
    return transform(cv2.Rodrigues(rotation)[0], translation[:, 0])


def _reprojection(world: Array, pixels: Array, lens: Intrinsics, camera_from_world: Array) -> float:
    seen = project_points(world @ camera_from_world[:3, :3].T + camera_from_world[:3, 3], lens)
    error = float(((seen - pixels) ** 2).sum())
    return error if np.isfinite(error) else np.inf
