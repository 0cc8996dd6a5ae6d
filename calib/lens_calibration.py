"""A camera's lens from the target's points in one view or several."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.disks import centroid_offsets
from calib.errors import UnsolvableError
from calib.observations import Observation
from calib.pose_from_view import pose_from_view
from calib.session import Intrinsics
from calib.transforms import inverse, transform
from calib.tsai import tsai

Array = NDArray[np.float64]

FEWEST_POINTS = 6
DISK_PASSES = 2
POORLY_KNOWN = 0.02
"""Relative standard deviation of the focal length above which a warning is given."""


@dataclass(frozen=True, eq=False)
class CameraViews:
    """A lens, the poses `world_from_camera` (n, 4, 4) at which it explains the views, warnings in words."""

    lens: Intrinsics
    poses: Array
    warnings: list[str]


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
    world = [points[observation.ids] for observation in observations]
    pixels = [observation.pixels for observation in observations]
    result = _calibrate(world, pixels, size, known)
    for _ in range(DISK_PASSES):
        if disk_diameter is None or not any(observation.disk for observation in observations):
            break
        centres = [
            observation.pixels - centroid_offsets(where, inverse(pose), disk_diameter, result.lens)
            if observation.disk
            else observation.pixels
            for observation, where, pose in zip(observations, world, result.poses, strict=True)
        ]
        result = _calibrate(world, centres, size, known)
    return result


def _calibrate(
    world: list[Array], pixels: list[Array], size: tuple[int, int], known: Intrinsics | None
) -> CameraViews:
    if known is not None:
        poses = [pose_from_view(*seen, known) for seen in zip(world, pixels, strict=True)]
        return CameraViews(known, np.array(poses), [])
    if max(len(seen) for seen in pixels) < FEWEST_POINTS:
        raise UnsolvableError(
            f"no view shows more than {max(len(seen) for seen in pixels)} points of the target: "
            f"a lens needs {FEWEST_POINTS} or more, or known intrinsics in the session"
        )
    if len(world) == 1:
        centre = [(size[0] - 1) / 2, (size[1] - 1) / 2]
        single = tsai(world[0], pixels[0], centre)
        lens = single.intrinsics.model_copy(update={"width": size[0], "height": size[1]})
        warning = "the lens is known from a single view only: take several, tilted differently"
        return CameraViews(lens, single.world_from_camera[None], [warning])
    return _pinhole(world, pixels, size)


def _pinhole(world: list[Array], pixels: list[Array], size: tuple[int, int]) -> CameraViews:
    """Return OpenCV's model fitted to the views that show enough points, and the poses of all of them."""
    enough = [len(seen) >= FEWEST_POINTS for seen in pixels]
    flags = 0 if sum(enough) > 3 else cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_FIX_K3
    try:
        _, matrix, distortion, rotations, translations, deviations, *_ = cv2.calibrateCameraExtended(
            [where.astype(np.float32) for where, use in zip(world, enough, strict=True) if use],
            [seen.astype(np.float32) for seen, use in zip(pixels, enough, strict=True) if use],
            size,
            np.eye(3),
            np.zeros(5),
            flags=flags,
        )
    except cv2.error as error:
        raise UnsolvableError(
            "the lens could not be calibrated from these views: take some with the target tilted by "
            "20 degrees or more"
        ) from error
    lens = Intrinsics(
        model="opencv",
        width=size[0],
        height=size[1],
        fx=float(matrix[0, 0]),
        fy=float(matrix[1, 1]),
        cx=float(matrix[0, 2]),
        cy=float(matrix[1, 2]),
        distortion=[float(value) for value in distortion.ravel()[:5]],
    )
    fitted = iter(zip(rotations, translations, strict=True))
    poses = []
    for where, seen, use in zip(world, pixels, enough, strict=True):
        if use:
            rotation, translation = next(fitted)
            poses.append(inverse(transform(cv2.Rodrigues(rotation)[0], translation.ravel())))
        else:
            poses.append(pose_from_view(where, seen, lens))
    return CameraViews(
        lens, np.array(poses), _lens_warnings(lens, np.asarray(deviations, dtype=float).ravel())
    )


def _lens_warnings(lens: Intrinsics, deviations: Array) -> list[str]:
    relative = float(deviations[0] / lens.fx)
    if relative <= POORLY_KNOWN:
        return []
    return [
        f"the focal length is known to {100 * relative:.1f} % only, and with it every distance: "
        "tilt the target against the picture by 20 degrees or more, or give known intrinsics"
    ]
