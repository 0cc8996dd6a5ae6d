"""Rotations as quaternions, against an independent implementation."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from daemon.pose.quaternion import quaternions


def test_they_are_the_rotations_own() -> None:
    rotations = Rotation.random(500, random_state=0)
    found = quaternions(rotations.as_matrix())
    assert np.allclose(found, rotations.as_quat(canonical=True), atol=1e-12)
    assert np.all(found[:, 3] >= 0)


@pytest.mark.parametrize("axis", [*np.eye(3), [1.0, 1.0, 0.0], [-1.0, 2.0, 0.5]])
@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, np.pi - 1e-9, np.pi])
def test_the_ends_of_the_scale_lose_no_digits(axis: NDArray[np.float64], angle: float) -> None:
    rotation = Rotation.from_rotvec(angle * np.array(axis) / np.linalg.norm(axis))
    (found,) = quaternions(rotation.as_matrix()[None])
    assert np.allclose(Rotation.from_quat(found).as_matrix(), rotation.as_matrix(), atol=1e-14)
