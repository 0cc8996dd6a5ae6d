"""Rigid motions of the simulated world, as products of exponentials.

Rotations are (3, 3), transforms (4, 4), lengths in metres, angles in radians; see `docs` for the frames.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drivers.axis import JointKind

Matrix = NDArray[np.float64]


def rotation(axis: ArrayLike, angle: float) -> Matrix:
    """Return the (3, 3) rotation by `angle` about the unit vector `axis` (Rodrigues' formula)."""
    x, y, z = np.asarray(axis, float)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned: Matrix = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
    return turned


def rotation_from_vector(vector: ArrayLike) -> Matrix:
    """Return the (3, 3) rotation whose axis times angle is `vector`."""
    array = np.asarray(vector, float)
    angle = float(np.linalg.norm(array))
    return rotation(array / angle, angle) if angle > 0.0 else np.eye(3)


def looking_at(position: ArrayLike, target: ArrayLike, up: ArrayLike) -> Matrix:
    """Return world_from_camera's (3, 3) rotation of a camera that looks from one point at another.

    Camera axes are x right, y down, z forward. Raises ValueError where the points coincide or `up` is the
    viewing direction.
    """
    forward = np.asarray(target, float) - np.asarray(position, float)
    right = np.cross(forward, np.asarray(up, float))
    if np.linalg.norm(right) <= 1e-9 * np.linalg.norm(forward) * np.linalg.norm(up):
        raise ValueError("the camera cannot look along its own 'up', nor at its own position")
    z = forward / np.linalg.norm(forward)
    x = right / np.linalg.norm(right)
    return np.column_stack([x, np.cross(z, x), z])


def transform(rotation_matrix: Matrix, position: ArrayLike) -> Matrix:
    """Return the (4, 4) transform of a rotation and a position."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_matrix
    matrix[:3, 3] = position
    return matrix


def screw(kind: JointKind, axis: ArrayLike, point: ArrayLike, displacement: float) -> Matrix:
    """Return exp(S q), the (4, 4) motion of whatever a joint carries when it is displaced by `displacement`.

    `axis` is a unit vector and `point` a point of the axis, both in the world at displacement 0.
    """
    if kind == "prismatic":
        return transform(np.eye(3), np.asarray(axis, float) * displacement)
    turn = rotation(axis, displacement)
    centre = np.asarray(point, float)
    return transform(turn, centre - turn @ centre)
