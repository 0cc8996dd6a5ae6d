"""Where points of the world are seen, and how sure a calibration is of it. numpy alone."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib.lens import project_points
from calib.likelihood.lens_terms import lens_vector, pixel_terms
from calib.parameters import lens_paths
from calib.pose_covariance import PoseTerms, TwistCovariance
from calib.session import Intrinsics
from calib.transforms import inverse
from calib.twists import skew

Array = NDArray[np.float64]


def projected(points: Array, poses: Array, lens: Intrinsics) -> Array:
    """Return where `points` (p, 3) in the world are seen from `poses` (..., 4, 4): pixels (..., p, 2)."""
    return project_points(_in_camera(points, poses), lens)


def lens_by_number(camera: int, lens: Intrinsics, parameters: Sequence[str]) -> Array:
    """Return the derivatives (l, p) of a camera's lens by the document's numbers called `parameters`."""
    paths = [f"cameras.{camera}.intrinsics.{path}" for path in lens_paths(lens.model)]
    return np.array([[float(name == path) for name in parameters] for path in paths])


def projection_covariances(
    points: Array, poses: Array, lens: Intrinsics, terms: PoseTerms, known: TwistCovariance, by_number: Array
) -> Array:
    """Return the covariances (n, p, 2, 2) of the pixels of `points` (p, 3) seen from `poses` (n, 4, 4), in px^2.

    `terms` are those of the poses, `known` is the chain's covariance, `by_number` (l, q) the lens's derivatives by the
    document's numbers.
    """
    seen = _in_camera(points, poses)
    _, by_point, by_lens = pixel_terms(np.moveaxis(seen, -1, 0), lens_vector(lens), lens.model)
    by_point, by_lens = np.moveaxis(by_point, (0, 1), (2, 3)), np.moveaxis(by_lens, (0, 1), (2, 3))
    # A twist of the camera moves a point the other way: d point = point x omega - rho.
    by_pose = np.concatenate([by_point @ skew(seen), -by_point], axis=-1)
    change = by_pose @ (terms.by_twist @ known.by_number)[:, None] + by_lens @ by_number
    unknown = by_pose @ terms.unknown[:, None]
    covariances = change @ known.numbers @ np.swapaxes(change, -1, -2)
    return np.asarray(covariances + unknown @ np.swapaxes(unknown, -1, -2))


def _in_camera(points: Array, poses: Array) -> Array:
    """Return `points` (p, 3) in the frames of cameras at `poses` (..., 4, 4): (..., p, 3)."""
    camera_from_world = inverse(poses)
    turned = points @ np.swapaxes(camera_from_world[..., :3, :3], -1, -2)
    return np.asarray(turned + camera_from_world[..., None, :3, 3])
