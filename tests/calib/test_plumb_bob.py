"""A lens as a plumb bob: OpenCV sees with it what we see, exactly or as nearly as is said."""

from typing import Any

import cv2
import numpy as np
import pytest

from calib.errors import CalibError
from calib.lens import pixel_rays, project_points
from calib.plumb_bob import plumb_bob
from calib.session import Intrinsics

RNG = np.random.default_rng(3)


def lens(**changes: Any) -> Intrinsics:
    numbers = {
        "model": "division",
        "width": 1280,
        "height": 960,
        "fx": 1400,
        "fy": 1395,
        "cx": 655,
        "cy": 470,
    }
    return Intrinsics.model_validate(numbers | {"distortion": [-0.3]} | changes)


def pixels_by_opencv(points: np.ndarray, seen: Intrinsics) -> np.ndarray:
    said = plumb_bob(seen, "main")
    return cv2.projectPoints(points, np.zeros(3), np.zeros(3), said.matrix, said.distortion)[0][:, 0]


def test_our_own_model_is_opencvs() -> None:
    ours = lens(model="opencv", distortion=[-0.2, 0.1, 0.001, -0.002, 0.03])
    points = np.column_stack([RNG.uniform(-0.5, 0.5, (200, 2)), np.ones(200)]) * RNG.uniform(0.5, 3, (200, 1))
    np.testing.assert_allclose(pixels_by_opencv(points, ours), project_points(points, ours), atol=1e-9)
    assert plumb_bob(ours, "main").off_px == 0


@pytest.mark.parametrize("distortion", [-0.45, -0.3, -0.1, 0.0, 0.3])
def test_a_division_lens_is_said_as_nearly_as_it_says(distortion: float) -> None:
    ours = lens(distortion=[distortion])
    pixels = RNG.uniform(0, [1279, 959], (2000, 2))
    corners = np.array([[0, 0], [1279, 0], [0, 959], [1279, 959]], dtype=float)
    points = pixel_rays(np.concatenate([pixels, corners]), ours)
    away = np.linalg.norm(pixels_by_opencv(points, ours) - np.concatenate([pixels, corners]), axis=1)
    stated = plumb_bob(ours, "main").off_px
    assert away.max() <= stated + 1e-9
    assert away.max() > 0.8 * stated


def test_a_lens_too_far_from_any_is_refused_with_how_far() -> None:
    with pytest.raises(
        CalibError, match=r"camera 'main' is of the model 'division', .* off by up to 4\.6 px"
    ):
        plumb_bob(lens(fx=700, fy=700, distortion=[-0.2]), "main")
    with pytest.raises(CalibError, match="it ends within the picture"):
        plumb_bob(lens(fx=700, fy=700, distortion=[-1.0]), "main")
    with pytest.raises(CalibError, match="a picture whose size is not known"):
        plumb_bob(lens(width=None, height=None), "main")
