"""Poses that another system gives, and its own imperfection: it may see y larger than x.

A camera whose pixels are not quite square, and are taken for it, reports its target too far out in y: no joint can do
that, and joints would be bent to explain it. As in lens models, x is the measure, and y has an aspect.
"""

import numpy as np
from numpy.typing import NDArray

from calib.transforms import inverse

Array = NDArray[np.float64]

ASPECT = np.array([0.0, 1.0, 0.0])
"""By how much of the aspect a sensor sees x, y and z too large."""


def without_aspect(poses: Array, aspect: float) -> Array:
    """Return the poses `world_from_camera` (..., 4, 4) that a sensor would give if it saw y as large as x.

    `aspect` is by how much more it sees y than x. What it sees is where the world's origin lies in its own frame.
    """
    if aspect == 0:
        return poses
    straight = inverse(poses)
    straight[..., :3, 3] *= 1 - aspect * ASPECT
    return inverse(straight)
