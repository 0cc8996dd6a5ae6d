"""What the closed form and the detectors make of measurements from real rigs."""

import pytest

from calib import load_session, solve, verify
from calib.errors import UnsolvableError
from calib.observations import observe
from tests.data import real


def test_positioner_is_predicted_away_from_its_two_sweeps() -> None:
    calibration = solve(load_session(real("positioner-cross")), method="closed_form")
    verdict = verify(calibration, load_session(real("positioner-rest")))
    assert verdict.views == 177
    assert verdict.position_m is not None
    assert verdict.rotation_rad is not None
    assert verdict.position_m.mean < 0.50e-3
    assert verdict.rotation_rad.mean < 1.0e-3
    assert verdict.mean_px is None


def test_lens_of_opencv_left() -> None:
    calibration = solve(load_session(real("opencv-left")))
    lens = calibration.cameras[0].intrinsics
    assert lens is not None
    assert lens.fx == pytest.approx(535.92, rel=0.01)
    assert lens.fy == pytest.approx(535.92, rel=0.01)
    assert calibration.quality.rms_px is not None
    assert calibration.quality.rms_px < 0.6
    assert len(calibration.quality.views) >= 12
    assert calibration.cameras[0].link_from_camera is None


def test_chessboard_is_found_in_every_picture_of_the_arm() -> None:
    observed = observe(load_session(real("nachi0117")))
    assert len(observed.observations) == 24
    assert all(len(observation.ids) == 88 for observation in observed.observations)


def test_free_views_are_not_enough_for_the_closed_form() -> None:
    with pytest.raises(UnsolvableError, match="joint 'j1' was never moved alone"):
        solve(load_session(real("nachi0117")), method="closed_form")
