"""Poses that a sensor gives which sees y larger than x."""

import numpy as np
import pytest

from calib import solve, verify
from calib.calibration import Calibration
from calib.pose_sensor import without_aspect
from calib.session import Session
from calib.transforms import inverse
from calib.twists import exp_twist
from tests.calib.rigs import Rig, pose_session, random_rig

ASPECT = 1.5e-3
TURNED, MOVED = 2e-4, 1e-4
"""Noise (rad, m) of what the sensor sees of the target, in each direction."""


def turntable_and_tilt(seed: int) -> Rig:
    return random_rig(np.random.default_rng(seed), ["revolute", "revolute"], ["skew"])


def seen_by_a_sensor(rig: Rig, aspect: float, seed: int, use: str = "fit") -> Session:
    """Return a session of noisy poses from a sensor with this aspect, each joint swept alone, then both together."""
    rng = np.random.default_rng(seed)
    angles = [("j0", [a, 0.0]) for a in np.linspace(-3, 3, 13)]
    angles += [("j1", [0.0, a]) for a in np.linspace(-1, 1, 13)]
    readings = [(joint, np.array(at) / rig.scales) for joint, at in angles]
    session = pose_session(rig, readings)
    views = []
    for view in session.views:
        assert view.world_from_camera is not None
        seen = inverse(without_aspect(np.array(view.world_from_camera), -aspect))
        seen[:3, :3] = exp_twist(TURNED * np.append(rng.normal(size=3), [0, 0, 0]))[:3, :3] @ seen[:3, :3]
        seen[:3, 3] += MOVED * rng.normal(size=3)
        views.append(view.model_copy(update={"world_from_camera": inverse(seen).tolist(), "use": use}))
    return session.with_views(views)


def test_what_a_sensor_sees_askew_is_taken_out() -> None:
    rng = np.random.default_rng(0)
    poses = exp_twist(rng.normal(size=(5, 6)))
    askew = without_aspect(poses, -ASPECT)
    there, seen = inverse(poses)[:, :3, 3], inverse(askew)[:, :3, 3]
    assert np.allclose(seen, there * [1, 1 + ASPECT, 1], atol=1e-12)
    assert np.allclose(without_aspect(askew, ASPECT), poses, atol=1e-5)
    assert without_aspect(poses, 0.0) is poses


def solved(aspect: float, seed: int) -> Calibration:
    return solve(seen_by_a_sensor(turntable_and_tilt(seed), aspect, seed))


def test_a_sensors_aspect_is_found_and_said() -> None:
    calibration = solved(ASPECT, 3)
    (found,) = calibration.corrections.aspect
    assert found.camera == "main"
    assert found.aspect_std is not None
    assert found.aspect == pytest.approx(ASPECT, abs=4 * found.aspect_std)
    assert 0 < found.aspect_std < ASPECT / 5
    (sentence,) = calibration.quality.corrections
    assert sentence.startswith("main: the poses given for it have the target too far out in y by 0.1")


def test_held_out_poses_are_judged_without_the_aspect() -> None:
    rig = turntable_and_tilt(3)
    calibration = solve(seen_by_a_sensor(rig, ASPECT, 3))
    unseen = seen_by_a_sensor(rig, ASPECT, 4, use="verify")
    verdict = verify(calibration, unseen)
    uncorrected = calibration.model_copy(
        update={"corrections": calibration.corrections.model_copy(update={"aspect": []})}
    )
    askew = verify(uncorrected, unseen)
    assert verdict.position_m is not None
    assert askew.position_m is not None
    # The mean length of three directions' noise.
    assert verdict.position_m.mean == pytest.approx(1.6 * MOVED, rel=0.25)
    assert askew.position_m.mean > 1.5 * verdict.position_m.mean


def test_a_straight_sensor_has_no_aspect() -> None:
    assert [seed for seed in range(12) if solved(0.0, seed).corrections.aspect] == []
