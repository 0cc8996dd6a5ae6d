"""From world points to pixels at given readings, and from pixels to rays in the world."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.lens import pixel_rays, project_points
from daemon.pose.active import ActiveCalibration

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """For n readings and k pixels: camera centres (n, 3) and unit directions (n, k, 3), nan where none."""

    origins: Array
    directions: Array


def project(
    active: ActiveCalibration,
    points: Array,
    readings: Array,
    camera: str | None,
    approached: Array | None = None,
) -> Array:
    """Return the pixels (n, k, 2) of world points (k, 3; m) at readings (n, m); nan where the lens sees none.

    `approached` (n, m) are the readings' sides, none known by default. Raises UnknownCameraError, LensUnknownError,
    ReadingsError.
    """
    lens = active.lens(camera)
    poses = active.poses(readings, camera, approached).world_from_camera
    with np.errstate(all="ignore"):
        # Row vectors: p_camera = R^T (p_world - t).
        in_camera = (points[None] - poses[:, None, :3, 3]) @ poses[:, :3, :3]
        return project_points(in_camera, lens)


def rays(
    active: ActiveCalibration,
    pixels: Array,
    readings: Array,
    camera: str | None,
    approached: Array | None = None,
) -> Rays:
    """Return the rays in the world along which `pixels` (k, 2) look at readings (n, m).

    `approached` (n, m) are the readings' sides, none known by default. Raises UnknownCameraError, LensUnknownError,
    ReadingsError.
    """
    lens = active.lens(camera)
    poses = active.poses(readings, camera, approached).world_from_camera
    with np.errstate(all="ignore"):
        directions = pixel_rays(pixels, lens)
        return Rays(poses[:, :3, 3], directions[None] @ poses[:, :3, :3].transpose(0, 2, 1))
