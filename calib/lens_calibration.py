"""A camera's lens from the target's points in one view or several."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle import adjust
from calib.disks import centroid_offsets
from calib.errors import UnsolvableError
from calib.homography import first_focal_lengths, homographies, planar_poses
from calib.lens import camera_matrix
from calib.likelihood.lens_terms import lens_vector
from calib.likelihood.measurements import point_views
from calib.observations import Observation
from calib.pose_from_view import pose_from_view
from calib.session import Intrinsics
from calib.transforms import inverse
from calib.tsai import tsai

Array = NDArray[np.float64]

FEWEST_POINTS = 6
DISK_PASSES = 2
FEW_VIEWS = 3
POORLY_KNOWN = 0.02
"""Relative standard deviation of the focal length above which a warning is given."""


@dataclass(frozen=True, eq=False)
class CameraViews:
    """A lens, and the poses `world_from_camera` (n, 4, 4) at which it explains the views.

    `focal_std` is the standard deviation of its focal length, relative to it: 0 where it was known, None where a
    single view says nothing of it.
    """

    lens: Intrinsics
    poses: Array
    focal_std: float | None


def calibrate_camera(
    points: Array,
    observations: Sequence[Observation],
    size: tuple[int, int],
    disk_diameter: float | None,
    known: Intrinsics | None = None,
) -> CameraViews:
    """Return the lens, unless `known`, and the camera's pose in each view.

    `points` (p, 3) are the target's by id (m), `size` the picture's width and height (px). Several views
    give OpenCV's pinhole model with its distortion, a single one Tsai's with the division model. Where the
    pixels are centroids of disks, they are referred to the disks' centres by the lens and poses found so
    far.
    """
    if known is not None:
        return CameraViews(known, _poses_of_known_lens(points, observations, known, disk_diameter), 0.0)
    most = max(len(observation.ids) for observation in observations)
    if most < FEWEST_POINTS:
        raise UnsolvableError(
            f"no view shows more than {most} points of the target: "
            f"a lens needs {FEWEST_POINTS} or more, or known intrinsics in the session"
        )
    if len(observations) == 1:
        return _single(points, observations[0], size, disk_diameter)
    return _several(points, observations, size, disk_diameter)


def _poses_of_known_lens(
    points: Array, observations: Sequence[Observation], lens: Intrinsics, disk_diameter: float | None
) -> Array:
    """Return the poses (n, 4, 4) in which a known lens sees each view."""
    poses = np.array([pose_from_view(points[seen.ids], seen.pixels, lens) for seen in observations])
    none_free = np.zeros(len(lens_vector(lens)), dtype=bool)
    return adjust(point_views(observations, points), lens, poses, none_free, disk_diameter).poses


def _single(
    points: Array, seen: Observation, size: tuple[int, int], disk_diameter: float | None
) -> CameraViews:
    """Return Tsai's lens from one view; centroids of disks are referred to their centres by what was found before."""
    world, pixels, centre = points[seen.ids], seen.pixels, [(size[0] - 1) / 2, (size[1] - 1) / 2]
    found = tsai(world, pixels, centre)
    for _ in range(DISK_PASSES):
        if disk_diameter is not None and seen.disk:
            camera_from_world = inverse(found.world_from_camera)
            pixels = seen.pixels - centroid_offsets(world, camera_from_world, disk_diameter, found.intrinsics)
            found = tsai(world, pixels, centre)
    lens = found.intrinsics.model_copy(update={"width": size[0], "height": size[1]})
    return CameraViews(lens, found.world_from_camera[None], None)


def _several(
    points: Array, observations: Sequence[Observation], size: tuple[int, int], disk_diameter: float | None
) -> CameraViews:
    """Return OpenCV's model fitted to the views that show enough points, and the poses of all of them."""
    enough = np.array([len(observation.ids) >= FEWEST_POINTS for observation in observations])
    fitted = [observation for observation, use in zip(observations, enough, strict=True) if use]
    seen = point_views(fitted, points)
    centre = (np.array(size) - 1) / 2
    planes = homographies(seen.world, seen.pixels, seen.present)
    fx, fy = first_focal_lengths(planes, centre)
    first = Intrinsics(
        model="opencv",
        width=size[0],
        height=size[1],
        fx=fx,
        fy=fy,
        cx=float(centre[0]),
        cy=float(centre[1]),
        distortion=[0.0] * 5,
    )
    # Few views cannot tell the principal point, nor the highest power of the distortion.
    free = np.ones(9, dtype=bool)
    if len(fitted) <= FEW_VIEWS:
        free[[2, 3, 8]] = False
    bundle = adjust(seen, first, planar_poses(planes, camera_matrix(first)), free, disk_diameter)
    poses = np.zeros((len(observations), 4, 4))
    poses[enough] = bundle.poses
    if not enough.all():
        others = [observation for observation, use in zip(observations, enough, strict=True) if not use]
        poses[~enough] = _poses_of_known_lens(points, others, bundle.lens, disk_diameter)
    return CameraViews(bundle.lens, poses, float(np.sqrt(bundle.covariance[0, 0])) / bundle.lens.fx)


def lens_in_words(camera: str, focal_std: float | None) -> list[str]:
    """Return a sentence where a camera's lens is known worse than every distance should be."""
    if focal_std is None:
        return [
            f"camera '{camera}': its lens is known from a single view only: take several, tilted differently"
        ]
    if focal_std <= POORLY_KNOWN:
        return []
    return [
        f"camera '{camera}': the focal length is known to {100 * focal_std:.1f} % only, and with it every distance: "
        "tilt the target against the picture by 20 degrees or more, or give known intrinsics"
    ]
