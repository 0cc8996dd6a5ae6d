"""Twists: small motions as vectors of six, rotation first. numpy alone."""

import numpy as np
from numpy.typing import NDArray

from calib.chain import Chain
from calib.transforms import transform

Array = NDArray[np.float64]


def joint_screw(chain: Chain, joint: int) -> Array:
    """Return the joint's unit screw (6,), rotation first, in the world at readings 0."""
    axis, point = chain.axes[joint], chain.points[joint]
    if chain.revolute[joint]:
        return np.concatenate([axis, skew(point) @ axis])
    return np.concatenate([np.zeros(3), axis])


def exp_twist(twists: Array) -> Array:
    """Return the motions (..., 4, 4) of `twists` (..., 6), rotation first."""
    turn, shift = twists[..., :3], twists[..., 3:]
    angle = np.linalg.norm(turn, axis=-1)[..., None, None]
    cross = skew(turn)
    square = cross @ cross
    # sinc keeps its digits at small angles: sin a / a, (1 - cos a) / a^2 and (a - sin a) / a^3.
    first, second = np.sinc(angle / np.pi), np.sinc(angle / (2 * np.pi)) ** 2 / 2
    small = angle < 1e-3
    third = np.where(small, 1 / 6 - angle**2 / 120, (1 - first) / np.where(small, 1, angle) ** 2)
    rotation = np.eye(3) + first * cross + second * square
    left = np.eye(3) + second * cross + third * square
    return transform(rotation, (left @ shift[..., None])[..., 0])


def adjoint(motions: Array) -> Array:
    """Return the matrices (..., 6, 6) that carry twists through `motions` (..., 4, 4)."""
    rotation, translation = motions[..., :3, :3], motions[..., :3, 3]
    result = np.zeros((*motions.shape[:-2], 6, 6))
    result[..., :3, :3] = result[..., 3:, 3:] = rotation
    result[..., 3:, :3] = skew(translation) @ rotation
    return result


def skew(vectors: Array) -> Array:
    """Return the cross product matrices (..., 3, 3) of `vectors` (..., 3)."""
    result = np.zeros((*vectors.shape, 3))
    result[..., 0, 1], result[..., 0, 2] = -vectors[..., 2], vectors[..., 1]
    result[..., 1, 0], result[..., 1, 2] = vectors[..., 2], -vectors[..., 0]
    result[..., 2, 0], result[..., 2, 1] = -vectors[..., 1], vectors[..., 0]
    return result
