"""What each view says of its camera's pose, lens and target: its information, gradient and misfit.

A view knows only a local vector x = (xi, lens, warp): a twist of its pose in the camera's frame, the lens's numbers,
the target's warp. All points enter here and nowhere later, so that the rest of the fit costs as much as there
are views.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.disks import centroid_offsets
from calib.likelihood.lens_terms import pixel_terms
from calib.likelihood.measurements import GivenPoses, PointViews
from calib.session import Intrinsics
from calib.transforms import inverse, rotation_log
from calib.twists import skew

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Blocks:
    """Of n views: `hessian` (n, d, d) and `gradient` (n, d) of half the `cost` (n,) by the local vector.

    `residuals` (n, q, 2) or (n, 6) are whitened, predicted less measured, unweighted, and `jacobian` (n, r, d) is
    theirs, weighted, flat.
    """

    hessian: Array
    gradient: Array
    cost: Array
    residuals: Array
    jacobian: Array


def point_blocks(
    seen: PointViews,
    poses: Array,
    lens: Array,
    model: str,
    offsets: Array,
    weights: Array,
    bulge: Array,
    bulges: Array,
) -> Blocks:
    """Return the blocks of views whose cameras are predicted at `poses` (n, 4, 4).

    `offsets` (n, q, 2) is what centroids of disks are off by (px), `weights` (n, q) those of the points,
    `bulge` (n, q) how far the target's points lie out of its plane (m), `bulges` (n, q, w) its derivatives.
    """
    camera_from_world = inverse(poses)[:, None]
    rotation, normal = camera_from_world[..., :3, :3], camera_from_world[..., :3, 2]
    points = (rotation @ seen.world[..., None])[..., 0] + camera_from_world[..., :3, 3]
    points = points + bulge[..., None] * normal
    pixels, by_point, by_lens = pixel_terms(points, lens, model)
    residuals = (seen.whitening @ (pixels + offsets - seen.pixels)[..., None])[..., 0]
    by_point = seen.whitening @ by_point
    # A twist of the camera moves a point the other way: d point = point x omega - rho.
    by_bulge = (by_point @ normal[..., None]) * bulges[..., None, :]
    local = [by_point @ skew(points), -by_point, seen.whitening @ by_lens, by_bulge]
    return _blocks(residuals, np.concatenate(local, axis=-1), weights[..., None])


def pose_blocks(given: GivenPoses, poses: Array, weights: Array) -> Blocks:
    """Return the blocks of views whose cameras are predicted at `poses` (n, 4, 4); `weights` (n,)."""
    residuals, jacobian = pose_residuals(given.poses, poses)
    whitened = residuals @ given.whitening.T
    return _blocks(whitened[..., None], (given.whitening @ jacobian)[..., None, :], weights[:, None, None])


def pose_residuals(measured: Array, predicted: Array) -> tuple[Array, Array]:
    """Return how predicted poses (n, 4, 4) differ from measured ones (n, 6), and its derivative by xi (n, 6, 6).

    The first three are the rotation in the camera's frame (rad), the last three where the world's origin lies in it
    (m): what a camera measures, and therefore with errors of about the same size in every view.
    """
    rotation = rotation_log(np.swapaxes(measured[:, :3, :3], 1, 2) @ predicted[:, :3, :3])
    origin = inverse(predicted)[:, :3, 3]
    shift = origin - inverse(measured)[:, :3, 3]
    jacobian = np.zeros((len(measured), 6, 6))
    jacobian[:, :3, :3] = np.eye(3)
    jacobian[:, 3:, :3] = skew(origin)
    jacobian[:, 3:, 3:] = -np.eye(3)
    return np.concatenate([rotation, shift], axis=1), jacobian


def disk_offsets(seen: PointViews, poses: Array, lens: Intrinsics, diameter: float | None) -> Array:
    """Return what the views' centroids of disks are off by (n, q, 2) in px; zeros where there are none."""
    offsets = np.zeros_like(seen.pixels)
    if diameter is not None and seen.disk.any():
        own = seen.disk
        offsets[own] = centroid_offsets(seen.world[own], inverse(poses[own]), diameter, lens)
    return offsets


def _blocks(residuals: Array, local: Array, weights: Array) -> Blocks:
    """Return the blocks of residuals (n, q, r) with derivatives (n, q, r, d), `weights` broadcast to (n, q, r)."""
    count, root = len(residuals), np.sqrt(weights)
    # What is set aside may be anything, even behind the camera.
    residuals = np.where((weights > 0) | np.isfinite(residuals), residuals, 0.0)
    local = np.where((weights > 0)[..., None] | np.isfinite(local), local, 0.0)
    flat = (residuals * root).reshape(count, -1, 1)
    jacobian = (local * root[..., None]).reshape(count, flat.shape[1], local.shape[-1])
    transposed = np.swapaxes(jacobian, 1, 2)
    return Blocks(
        hessian=transposed @ jacobian,
        gradient=(transposed @ flat)[..., 0],
        cost=(flat[..., 0] ** 2).sum(axis=1),
        residuals=residuals,
        jacobian=jacobian,
    )
