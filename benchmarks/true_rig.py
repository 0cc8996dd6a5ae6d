"""Rigs with known truth, by a forward model of their own: matrix exponentials of twists.

It shares no formula with what it judges: `calib` works with closed forms, and the simulated drivers have theirs.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Rig:
    """Joints `kinds` in chain order and the camera's pose `mount` (4, 4), all in the world at readings 0.

    `axes` (m, 3) are unit vectors, `points` (m, 3) lie on them (m; any for a prismatic joint), and `scales` (m,)
    turn a reading into radians or metres.
    """

    kinds: list[str]
    axes: Array
    points: Array
    scales: Array
    mount: Array

    def pose(self, readings: ArrayLike) -> Array:
        """Return the camera's pose `world_from_camera` (4, 4) at readings (m,)."""
        return self.poses(np.asarray(readings, dtype=float)[None])[0]

    def poses(self, readings: ArrayLike) -> Array:
        """Return the camera's poses `world_from_camera` (n, 4, 4) at readings (n, m)."""
        values = np.asarray(readings, dtype=float)
        poses = np.broadcast_to(np.eye(4), (len(values), 4, 4))
        for joint, kind in enumerate(self.kinds):
            twist, axis = np.zeros((4, 4)), self.axes[joint]
            if kind == "revolute":
                twist[:3, :3] = np.cross(np.eye(3), axis)
                twist[:3, 3] = np.cross(self.points[joint], axis)
            else:
                twist[:3, 3] = axis
            poses = poses @ expm(twist * (self.scales[joint] * values[:, joint, None, None]))
        return poses @ self.mount


def unit(vector: ArrayLike) -> Array:
    """Return a vector's direction."""
    direction: Array = np.asarray(vector, dtype=float) / np.linalg.norm(vector)
    return direction
