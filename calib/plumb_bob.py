"""A lens as others take it: a camera matrix, and the distortion k1 k2 p1 p2 k3 that ROS calls the plumb bob.

The `opencv` model is just that. The division model is radial, as a plumb bob without p1 and p2 is, and the one nearest
to it over the picture is said, with how far it is off.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.errors import CalibError
from calib.lens import camera_matrix, pixels_to_normalised, undistort
from calib.session import Intrinsics

Array = NDArray[np.float64]

GRID = 60
"""Points each way over the picture at which the models are compared."""
FARTHEST = 0.5
"""How far off (px) a plumb bob may be to be taken for the lens."""


@dataclass(frozen=True, eq=False)
class PlumbBob:
    """A camera's `matrix` (3, 3), `distortion` (5,) k1 k2 p1 p2 k3, and by how much it is off at most (px)."""

    matrix: Array
    distortion: Array
    off_px: float


def plumb_bob(lens: Intrinsics, camera: str) -> PlumbBob:
    """Return the lens of `camera` as a plumb bob, exact for the model `opencv`.

    Raises CalibError where the nearest one is off by more than `FARTHEST`, or the picture's size is not known.
    """
    if lens.model == "opencv":
        return PlumbBob(camera_matrix(lens), np.array(lens.distortion, dtype=float), 0.0)
    refused = f"the lens of camera '{camera}' is of the model '{lens.model}', which k1 k2 p1 p2 k3 cannot say"
    if lens.width is None or lens.height is None:
        raise CalibError(f"{refused} but about, over a picture whose size is not known")
    across, down = np.meshgrid(
        np.linspace(-0.5, lens.width - 0.5, GRID), np.linspace(-0.5, lens.height - 0.5, GRID)
    )
    distorted = pixels_to_normalised(np.column_stack([across.ravel(), down.ravel()]), lens)
    flat = undistort(distorted, lens)
    if np.isnan(flat).any():
        raise CalibError(f"{refused}: it ends within the picture")
    square = (flat**2).sum(axis=1)
    focal = np.array([lens.fx, lens.fy])
    # In px: what k1, k2 and k3 each add to a point, and what the lens does.
    shapes = (focal * flat)[:, :, None] * (square[:, None] ** [1, 2, 3])[:, None, :]
    wanted = focal * (distorted - flat)
    (k1, k2, k3), *_ = np.linalg.lstsq(shapes.reshape(-1, 3), wanted.ravel(), rcond=None)
    off = float(np.linalg.norm(wanted - shapes @ [k1, k2, k3], axis=1).max())
    if off > FARTHEST:
        raise CalibError(f"{refused}: the nearest is off by up to {off:.2g} px in the picture")
    return PlumbBob(camera_matrix(lens), np.array([k1, k2, 0.0, 0.0, k3]), off)
