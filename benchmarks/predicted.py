"""Where a calibrated camera should see points, to be held against the simulator's own projection."""

import numpy as np
from numpy.typing import NDArray

from calib import Calibration
from calib.lens import project_points
from calib.transforms import inverse

Array = NDArray[np.float64]


def predicted_pixels(calibration: Calibration, points: Array, readings: Array) -> Array:
    """Return the pixels (n, p, 2) of world points (p, 3) at readings (n, m)."""
    lens = calibration.cameras[0].intrinsics
    assert lens is not None
    camera_from_world = inverse(calibration.world_from_camera(readings))
    seen = points @ np.swapaxes(camera_from_world[:, :3, :3], 1, 2) + camera_from_world[:, None, :3, 3]
    return project_points(seen, lens)
