"""Tsai's two stages are exact on exact points, coplanar or not, wherever the origin is seen."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from calib.errors import UnsolvableError
from calib.lens import project_points
from calib.session import Intrinsics
from calib.transforms import inverse, pose_error, transform
from calib.tsai import tsai

CENTRE = [640.0, 480.0]


@settings(max_examples=150, deadline=None)
@given(st.booleans(), st.integers(0, 2**32 - 1))
def test_exact(coplanar: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    focal, aspect = rng.uniform(500, 3000), rng.uniform(0.9, 1.1)
    lens = Intrinsics(
        model="division", fx=focal * aspect, fy=focal, cx=640, cy=480, distortion=[rng.uniform(-0.3, 0.1)]
    )
    world = rng.uniform(-0.1, 0.3, (30, 3)) * [1, 1, 0 if coplanar else 1]
    camera_from_world = transform(_tilted(rng), [*rng.uniform(-0.1, 0.1, 2), rng.uniform(1, 2)])
    pixels = project_points(world @ camera_from_world[:3, :3].T + camera_from_world[:3, 3], lens)
    found = tsai(world, pixels, CENTRE, aspect)
    distance, angle = pose_error(found.world_from_camera[None], inverse(camera_from_world)[None])
    assert max(distance[0], angle[0]) < 1e-7
    assert found.intrinsics.fx == pytest.approx(lens.fx, rel=1e-7)
    assert found.intrinsics.distortion[0] == pytest.approx(lens.distortion[0], abs=1e-6)


def _tilted(rng: np.random.Generator) -> np.ndarray:
    while True:
        rotation = Rotation.from_rotvec(rng.uniform(-1, 1, 3) * [0.8, 0.8, 3.1]).as_matrix()
        if np.hypot(rotation[2, 0], rotation[2, 1]) > 0.1:
            return np.asarray(rotation)


def test_a_target_parallel_to_the_picture_is_refused() -> None:
    world = np.array([[x, y, 0] for x in range(4) for y in range(4)]) * 0.1
    pixels = 1000 * world[:, :2] / 2 + CENTRE
    with pytest.raises(UnsolvableError, match="parallel to the image plane"):
        tsai(world, pixels, CENTRE)


def test_too_few_points_are_refused() -> None:
    world = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]) * 0.1
    with pytest.raises(UnsolvableError, match="needs 6 points in a plane"):
        tsai(world, 1000 * world[:, :2], CENTRE)
