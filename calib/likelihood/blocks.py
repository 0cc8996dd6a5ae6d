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
from calib.pose_sensor import ASPECT, without_aspect
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
    camera_from_world = inverse(poses)
    normal = camera_from_world[:, :3, 2]
    points = camera_from_world[:, :3, :3] @ np.swapaxes(seen.world, 1, 2) + camera_from_world[:, :3, 3:]
    points += normal[..., None] * bulge[:, None]
    x, y, z = points = np.swapaxes(points, 0, 1)
    pixels, by_point, by_lens = pixel_terms(points, lens, model)
    misfit = pixels + np.moveaxis(offsets - seen.pixels, -1, 0)
    root = np.sqrt(weights)
    _whiten(misfit, seen.whitening)
    for derivative in (by_point, by_lens):
        _whiten(derivative, seen.whitening * root[..., None, None])
    # A twist of the camera moves a point the other way: d point = point x omega - rho.
    by_x, by_y, by_z = by_point[:, 0], by_point[:, 1], by_point[:, 2]
    by_turn = [by_y * z - by_z * y, by_z * x - by_x * z, by_x * y - by_y * x]
    by_normal = (by_point * normal.T[..., None]).sum(axis=1)
    by_bulge = [by_normal * shape for shape in np.moveaxis(bulges, -1, 0)]
    local = [*by_turn, -by_x, -by_y, -by_z, *np.swapaxes(by_lens, 0, 1), *by_bulge]
    jacobian = np.empty((len(poses), len(local), seen.present.shape[1], 2))
    np.stack(local, axis=1, out=jacobian.transpose(3, 1, 0, 2))
    residuals = np.stack([*misfit], axis=-1)
    aside = weights == 0
    if aside.any():
        # What is set aside may be anything, even behind the camera.
        residuals[aside] = np.nan_to_num(residuals[aside], posinf=0, neginf=0)
        np.swapaxes(jacobian, 1, 2)[aside] = 0
    flat = (residuals * root[..., None]).reshape(len(poses), -1)
    return _blocks(residuals, flat, jacobian.reshape(*jacobian.shape[:2], -1))


def pose_blocks(given: GivenPoses, poses: Array, weights: Array, own: Array, aspects: Array) -> Blocks:
    """Return the blocks of views whose cameras are predicted at `poses` (n, 4, 4); `weights` (n, 6).

    `own` (a,) tells which of the `aspects` (a,) is that of the sensor that gave the poses.
    """
    measured = without_aspect(given.poses, float(own @ aspects))
    residuals, jacobian = pose_residuals(measured, poses)
    by_aspect = np.zeros((len(poses), 6, len(own)))
    by_aspect[:, 3:] = (inverse(given.poses)[:, :3, 3] * ASPECT)[..., None] * own
    jacobian = np.concatenate([jacobian, by_aspect], axis=2)
    whitened, root = residuals @ given.whitening.T, np.sqrt(weights)
    by_twist = np.swapaxes(given.whitening @ jacobian, 1, 2)
    return _blocks(whitened[..., None], whitened * root, by_twist * root[:, None])


def loosened(blocks: Blocks, looseness: float) -> tuple[Array, Array, Array]:
    """Return hessian, gradient and cost of views whose pose may be off at random, each at its best.

    Pose errors have `looseness` times the covariance that the view's own points give its pose: then their
    elimination takes off a fixed share of what the points say of the pose, and nothing of what they say of the lens.
    """
    if looseness == 0:
        return blocks.hessian, blocks.gradient, blocks.cost
    share = looseness / (1 + looseness)
    by_pose = blocks.hessian[:, :6]
    own = by_pose[:, :, :6]
    # A view whose points were all set aside says nothing, and its zeros cannot be divided by.
    size = np.trace(own, axis1=1, axis2=2) + 1
    own = own + (1e-13 * size)[:, None, None] * np.eye(6)
    gain = share * np.linalg.solve(own, np.concatenate([by_pose, blocks.gradient[:, :6, None]], axis=2))
    transposed = np.swapaxes(by_pose, 1, 2)
    return (
        blocks.hessian - transposed @ gain[:, :, :-1],
        blocks.gradient - (transposed @ gain[:, :, -1:])[..., 0],
        blocks.cost - (blocks.gradient[:, :6] * gain[:, :, -1]).sum(axis=1),
    )


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


def out_of_date(seen: PointViews, held: Array, renewed: Array) -> float:
    """Return what renewing offsets (n, q, 2) can gain at most: how far they moved in units of noise, squared."""
    return float(np.nansum((seen.whitening @ (renewed - held)[..., None]) ** 2))


def said_of_poses(blocks: Blocks, weights: Array) -> tuple[Array, Array]:
    """Return the information (n, 6, 6) and gradient (n, 6) of poses, from blocks in which everything counts.

    `weights` are (n, q) of points, or (n, 6) of given poses.
    """
    flat = blocks.residuals.reshape(len(weights), -1)
    root = np.repeat(np.sqrt(weights), flat.shape[1] // weights.shape[1], axis=1)
    # What is set aside may be anything, even behind the camera.
    flat = np.where(root > 0, flat * root, 0.0)
    jacobian = np.swapaxes(blocks.jacobian[:, :, :6], 1, 2)
    jacobian = np.where(root[:, None] > 0, jacobian * root[:, None], 0.0)
    return jacobian @ np.swapaxes(jacobian, 1, 2), (jacobian @ flat[..., None])[..., 0]


def _whiten(rows: Array, whitening: Array) -> None:
    """Multiply what belongs to the coordinates of points, `rows` (2, ..., n, q), by `whitening` (n, q, 2, 2)."""
    rows[1] *= whitening[..., 1, 1]
    if whitening[..., 1, 0].any():
        rows[1] += whitening[..., 1, 0] * rows[0]
    rows[0] *= whitening[..., 0, 0]


def _blocks(residuals: Array, weighted: Array, transposed: Array) -> Blocks:
    """Return the blocks of `residuals`, which are `weighted` (n, r) with derivatives (n, d, r)."""
    jacobian = np.swapaxes(transposed, 1, 2)
    return Blocks(
        hessian=transposed @ jacobian,
        gradient=(transposed @ weighted[..., None])[..., 0],
        cost=(weighted**2).sum(axis=1),
        residuals=residuals,
        jacobian=jacobian,
    )
