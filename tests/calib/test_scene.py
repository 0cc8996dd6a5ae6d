"""The rig in 3-D: what is drawn is where it is, and as surely as it is known."""

import numpy as np
import pytest

from calib import Calibration, solve
from calib.errors import ReadingsError
from calib.scene import scene
from calib.transforms import inverse
from tests.calib.rigs import pose_session, random_rig
from tests.calib.scenes import DISK_CENTRES, HEIGHT, WIDTH
from tests.calib.test_comparison import calibrated, two_axis_rig

READINGS = [40.0, -5.0]


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    return calibrated(1)


def test_axes_are_where_the_readings_have_carried_them(calibration: Calibration) -> None:
    rig, found = two_axis_rig(), scene(calibration, READINGS)
    slide, pan = found.joints
    np.testing.assert_allclose(slide.axis, rig.axes[0], atol=5e-3)
    np.testing.assert_allclose(pan.axis, rig.axes[1], atol=5e-3)
    # The slide carries the pan's axis along; of it the point nearest to the camera is drawn.
    there, eye = rig.points[1] + 0.04 * rig.axes[0], found.cameras[0].pose[:3, 3]
    assert np.linalg.norm(np.cross(pan.point - there, rig.axes[1])) < 8e-3
    assert abs((eye - pan.point) @ pan.axis) < 1e-9


def test_the_last_links_frame_carries_the_camera(calibration: Calibration) -> None:
    for readings in (READINGS, [0.0, 0.0]):
        found = scene(calibration, readings)
        (camera,) = found.cameras
        np.testing.assert_allclose(camera.pose, calibration.world_from_camera(readings))
        mount = np.array(calibration.cameras[0].link_from_camera)
        np.testing.assert_allclose(found.joints[-1].frame @ mount, camera.pose, atol=1e-9)
    np.testing.assert_allclose(found.joints[0].frame[:3, 2], found.joints[0].axis, atol=1e-9)


def test_the_corners_of_the_picture_are_seen_there(calibration: Calibration) -> None:
    (camera,) = scene(calibration, READINGS).cameras
    assert camera.corners is not None
    pixels = calibration.project(camera.corners, READINGS)
    expected = [
        [-0.5, -0.5],
        [WIDTH - 0.5, -0.5],
        [WIDTH - 0.5, HEIGHT - 0.5],
        [-0.5, HEIGHT - 0.5],
    ]
    np.testing.assert_allclose(pixels, expected, atol=1e-6)


def test_the_target_lies_in_its_outline(calibration: Calibration) -> None:
    found = scene(calibration, READINGS)
    np.testing.assert_allclose(found.points, DISK_CENTRES)
    np.testing.assert_allclose(found.outline, [[0, 0, 0], [0.18, 0, 0], [0.18, 0.15, 0], [0, 0.15, 0]])


def test_ellipsoids_are_the_covariances(calibration: Calibration) -> None:
    found = scene(calibration, READINGS)
    (camera,), known = found.cameras, calibration.pose_covariance(READINGS)
    assert camera.sure is not None
    assert known is not None
    turn = camera.pose[:3, :3]
    again = camera.sure.axes @ np.diag(camera.sure.radii**2) @ camera.sure.axes.T
    np.testing.assert_allclose(again, turn @ known[3:, 3:] @ turn.T, atol=1e-16)
    assert found.joints[0].sure is None  # a straight axis lies anywhere
    assert found.joints[1].sure is not None


def test_an_axis_is_as_far_off_as_its_ellipsoid_says(calibration: Calibration) -> None:
    rig, standardised = two_axis_rig(), []
    for seed in range(8):
        pan = scene(calibrated(seed), READINGS).joints[1]
        assert pan.sure is not None
        there = rig.points[1] + 0.04 * rig.axes[0]
        off = pan.point - there
        off = off - (off @ pan.axis) * pan.axis
        covariance = pan.sure.axes @ np.diag(pan.sure.radii**2) @ pan.sure.axes.T
        across = np.linalg.svd(pan.axis[None])[2][1:]
        standardised.append(across @ off @ np.linalg.solve(across @ covariance @ across.T, across @ off) / 2)
    assert 0.3 < np.mean(standardised) < 2.5


def test_a_rig_of_given_poses_has_neither_picture_nor_target() -> None:
    rng = np.random.default_rng(2)
    rig = random_rig(rng, ["revolute"], [])
    session = pose_session(rig, [("j0", np.array([angle]) / rig.scales) for angle in np.linspace(0, 1, 6)])
    found = scene(solve(session), [0.3 / float(rig.scales[0])])
    assert found.cameras[0].corners is None
    assert (found.points.shape, found.outline.shape) == ((0, 3), (0, 3))
    assert np.isfinite(inverse(found.joints[0].frame)).all()


def test_readings_of_another_rig_are_refused(calibration: Calibration) -> None:
    with pytest.raises(ReadingsError):
        scene(calibration, [1.0])
