"""The lens models, there and back, and against OpenCV's projection."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib.lens import camera_matrix, pixel_rays, project_points
from calib.session import Intrinsics

OPENCV = Intrinsics(
    model="opencv", fx=800, fy=810, cx=320, cy=240, distortion=[-0.26, 0.1, 0.001, -0.0005, 0.02]
)
DIVISION = Intrinsics(model="division", fx=800, fy=810, cx=320, cy=240, distortion=[-0.2])

in_view = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(1.0, 5.0))


@given(st.lists(in_view, min_size=1, max_size=20), st.sampled_from([OPENCV, DIVISION]))
def test_rays_lead_back_to_the_points(points: list[tuple[float, float, float]], lens: Intrinsics) -> None:
    rays = pixel_rays(project_points(points, lens), lens)
    assert np.allclose(rays, np.array(points) / np.linalg.norm(points, axis=1, keepdims=True), atol=1e-12)


@given(st.lists(in_view, min_size=1, max_size=20))
def test_opencv_model_is_opencvs(points: list[tuple[float, float, float]]) -> None:
    theirs, _ = cv2.projectPoints(
        np.array(points), np.zeros(3), np.zeros(3), camera_matrix(OPENCV), np.array(OPENCV.distortion)
    )
    assert np.allclose(project_points(points, OPENCV), theirs[:, 0], atol=1e-9)


def test_division_model_is_the_papers() -> None:
    """Undistorted = distorted / (1 + k1 r_distorted^2), on normalised coordinates (errata, eq 19 and 20)."""
    pixel = project_points([0.3, -0.2, 1.0], DIVISION)
    distorted = (pixel - [320, 240]) / [800, 810]
    assert np.allclose(distorted / (1 - 0.2 * (distorted @ distorted)), [0.3, -0.2])


@pytest.mark.parametrize("lens", [OPENCV, DIVISION], ids=["opencv", "division"])
def test_what_is_behind_is_not_seen(lens: Intrinsics) -> None:
    assert np.isnan(project_points([[0.1, 0.1, -1.0], [0.1, 0.1, 0.0]], lens)).all()


def test_beyond_the_division_models_cone_is_not_seen() -> None:
    barrel = DIVISION.model_copy(update={"distortion": [0.3]})
    assert np.isfinite(project_points([0.9, 0.0, 1.0], barrel)).all()
    assert np.isnan(project_points([0.92, 0.0, 1.0], barrel)).all()
