"""A camera's lens from the target's points in one view or several."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.bundle import adjust
from calib.disks import centroid_offsets
from calib.errors import UnsolvableError
from calib.homography import first_focal_lengths, homographies, planar_poses
from calib.lens import camera_matrix
from calib.lens_prior import LensPrior
from calib.likelihood.lens_terms import lens_from_vector, lens_vector
from calib.likelihood.measurements import point_views
from calib.observations import Observation
from calib.parameters import LENS_NAMES
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
    known: Intrinsics | None,
    prior: Callable[[str], LensPrior],
) -> CameraViews:
    """Return the lens and the camera's pose in each view.

    `points` (p, 3) are the target's by id (m), `size` the picture's width and height (px). `known` is the lens as
    given, and `prior` says what is known of a lens of each model. Several views give OpenCV's pinhole model with its
    distortion, a single one Tsai's with the division model. Where the pixels are centroids of disks, they are
    referred to the disks' centres by the lens and poses found so far.
    """
    if known is not None:
        return _from_known(points, observations, known, prior(known.model), disk_diameter)
    most = max(len(observation.ids) for observation in observations)
    if most < FEWEST_POINTS:
        raise UnsolvableError(
            f"no view shows more than {most} points of the target: "
            f"a lens needs {FEWEST_POINTS} or more, or known intrinsics in the session"
        )
    if len(observations) == 1:
        return _single(points, observations[0], size, prior("division"), disk_diameter)
    return _several(points, observations, size, prior("opencv"), disk_diameter)


def _from_known(
    points: Array,
    observations: Sequence[Observation],
    known: Intrinsics,
    prior: LensPrior,
    disk_diameter: float | None,
) -> CameraViews:
    """Return a lens that is about known, and the poses (n, 4, 4) in which it sees each view."""
    lens = lens_from_vector(prior.imposed(lens_vector(known)), known)
    poses = np.array([pose_from_view(points[seen.ids], seen.pixels, lens) for seen in observations])
    bundle = adjust(point_views(observations, points), lens, poses, prior, disk_diameter)
    return CameraViews(bundle.lens, bundle.poses, bundle.focal_std())


def _single(
    points: Array, seen: Observation, size: tuple[int, int], prior: LensPrior, disk_diameter: float | None
) -> CameraViews:
    """Return Tsai's lens from one view; centroids of disks are referred to their centres by what was found before.

    A view of a plane tells neither the principal point nor the aspect.
    """
    world, pixels = points[seen.ids], seen.pixels
    prior = prior.with_aspect(prior.told_aspect() or 1.0)
    centre = prior.imposed(lens_vector(_pinhole("division", size)))[2:4]
    aspect = prior.aspect or 1.0
    found = tsai(world, pixels, centre, aspect)
    for _ in range(DISK_PASSES):
        if disk_diameter is not None and seen.disk:
            camera_from_world = inverse(found.world_from_camera)
            pixels = seen.pixels - centroid_offsets(world, camera_from_world, disk_diameter, found.intrinsics)
            found = tsai(world, pixels, centre, aspect)
    lens = found.intrinsics.model_copy(update={"width": size[0], "height": size[1]})
    if not np.any(prior.std[[0, 1, 4]] == 0):
        return CameraViews(lens, found.world_from_camera[None], None)
    told = np.array([True, True, False, False, True])
    return _from_known(points, [seen], lens, prior.at_first(lens_vector(lens), told), disk_diameter)


def _several(
    points: Array,
    observations: Sequence[Observation],
    size: tuple[int, int],
    prior: LensPrior,
    disk_diameter: float | None,
) -> CameraViews:
    """Return OpenCV's model fitted to the views that show enough points, and the poses of all of them."""
    enough = np.array([len(observation.ids) >= FEWEST_POINTS for observation in observations])
    fitted = [observation for observation, use in zip(observations, enough, strict=True) if use]
    seen = point_views(fitted, points)
    planes = homographies(seen.world, seen.pixels, seen.present)
    values = prior.imposed(lens_vector(_pinhole("opencv", size)))
    values[:2] = first_focal_lengths(planes, values[2:4])
    values = prior.imposed(values)
    first = lens_from_vector(values, _pinhole("opencv", size))
    # Few views cannot tell the principal point, nor the highest power of the distortion.
    told = np.ones(len(values), dtype=bool)
    if len(fitted) <= FEW_VIEWS:
        told[[2, 3, 8]] = False
    poses_of_planes = planar_poses(planes, camera_matrix(first))
    bundle = adjust(seen, first, poses_of_planes, prior.at_first(values, told), disk_diameter)
    poses = np.zeros((len(observations), 4, 4))
    poses[enough] = bundle.poses
    if not enough.all():
        others = [observation for observation, use in zip(observations, enough, strict=True) if not use]
        seen_so = _from_known(points, others, bundle.lens, LensPrior.exactly(bundle.lens), disk_diameter)
        poses[~enough] = seen_so.poses
    return CameraViews(bundle.lens, poses, bundle.focal_std())


def _pinhole(model: Literal["opencv", "division"], size: tuple[int, int]) -> Intrinsics:
    """Return a lens without distortion through the middle of the picture, of no focal length worth the name."""
    width, height = size
    return Intrinsics(
        model=model,
        width=width,
        height=height,
        fx=1.0,
        fy=1.0,
        cx=(width - 1) / 2,
        cy=(height - 1) / 2,
        distortion=[0.0] * (len(LENS_NAMES[model]) - 4),
    )


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
