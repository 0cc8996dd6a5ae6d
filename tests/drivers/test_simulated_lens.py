import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import OptionsError
from drivers.simulated.lens import Lens, ray_field

BROWN = Lens("opencv", 1000.0, 1010.0, 639.0, 481.0, (-0.25, 0.1, 0.002, -0.001, -0.02))
DIVISION = Lens("division", 1000.0, 1010.0, 639.0, 481.0, (-0.2,))
pixels = st.tuples(st.floats(0, 1279), st.floats(0, 959))


@pytest.mark.parametrize("lens", [BROWN, DIVISION])
@given(pixel=pixels)
def test_a_ray_goes_back_to_its_pixel(lens: Lens, pixel: tuple[float, float]) -> None:
    x, y = lens.directions([pixel])[0]
    assert np.abs(lens.project([[2 * x, 2 * y, 2.0]])[0] - pixel).max() < 1e-8


@given(pixel=pixels)
def test_the_division_model_is_the_papers(pixel: tuple[float, float]) -> None:
    x_d, y_d = (pixel[0] - 639.0) / 1000.0, (pixel[1] - 481.0) / 1010.0
    expected = np.array([x_d, y_d]) / (1 - 0.2 * (x_d**2 + y_d**2))
    assert np.allclose(DIVISION.directions([pixel])[0], expected, atol=1e-14)


def test_few_coefficients_are_followed_by_zeros() -> None:
    short = Lens("opencv", 1000.0, 1000.0, 0.0, 0.0, (-0.1,))
    K, point = np.diag([1000.0, 1000.0, 1.0]), np.array([[0.3, 0.2, 1.0]])
    expected, _ = cv2.projectPoints(point, np.zeros(3), np.zeros(3), K, np.array([-0.1, 0, 0, 0]))
    assert np.allclose(short.project([[0.3, 0.2, 1.0]]), expected[0])


@pytest.mark.parametrize("lens", [BROWN, DIVISION])
def test_the_ray_field_agrees_with_the_lens_at_every_pixel(lens: Lens) -> None:
    field = ray_field(lens, 1280, 960)
    v, u = np.mgrid[0:960:37, 0:1280:41]
    rays = lens.directions(np.column_stack([u.ravel(), v.ravel()]))
    inside = np.column_stack([field.x[1 + v, 1 + u].ravel(), field.y[1 + v, 1 + u].ravel()])
    assert np.abs(inside - rays).max() < 1e-7  # 1e-4 px, the resolution of 32 bits
    with pytest.raises(ValueError, match="read-only"):
        field.x[0, 0] = 0.0


def test_the_far_field_is_not_folded_into_the_picture() -> None:
    fold = Lens("opencv", 500.0, 500.0, 320.0, 240.0, (-0.3,))
    # x (1 - 0.3 x²) turns back at x = 1.05: from there on the lens shows nothing more.
    assert np.isfinite(fold.project([[1.0, 0.0, 1.0]])).all()
    assert np.isnan(fold.project([[1.6, 0.0, 1.0]])).all()
    assert np.isnan(Lens("division", 500.0, 500.0, 320.0, 240.0, (0.5,)).project([[1.0, 0.0, 1.0]])).all()


def test_a_lens_that_cannot_fill_the_picture_is_refused() -> None:
    with pytest.raises(OptionsError, match="cannot see all of its picture"):
        ray_field(Lens("opencv", 400.0, 400.0, 640.0, 480.0, (-0.3,)), 1280, 960)
