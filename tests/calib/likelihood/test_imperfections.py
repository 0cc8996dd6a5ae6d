"""Imperfect joints: errors that follow a rule are found by the data, and perfect joints are left alone."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from benchmarks.random_rigs import LookingRig, looking_rig, noisy_session, session_of_views
from calib import Calibration, solve, verify
from calib.session import Session
from calib.transforms import inverse, rotation_log

NOISE = 0.1
Truth = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From readings and sides of approach to what the joints really do, in reading units."""


def backlash(values: np.ndarray, sides: np.ndarray) -> np.ndarray:
    return values + sides * [0.03, 0, 0]


def eccentricity(values: np.ndarray, sides: np.ndarray) -> np.ndarray:
    off = 0.04 * np.sin(np.radians(values[:, 1]) + 0.7)
    return values + np.column_stack([0 * off, off, 0 * off])


def coupling(values: np.ndarray, sides: np.ndarray) -> np.ndarray:
    return values + np.column_stack([0 * values[:, 0], 0.01 * values[:, 0], 0 * values[:, 0]])


def rig_of_three(seed: int = 0) -> LookingRig:
    """Return a rig of three revolute joints, of which the second turns by 119 degrees."""
    looking = looking_rig(np.random.default_rng(seed), 3)
    assert looking.rig.kinds == ["revolute"] * 3
    return looking


def both_ways(looking: LookingRig, truth: Truth, seed: int, reading_noise: float = 0, **keys: Any) -> Session:
    """Return a session in which each reading of the joints' sweeps is approached from either side."""
    rng = np.random.default_rng(seed)
    plan = [view for view in looking.plan() for _ in range(2)]
    sides = np.ones((len(plan), len(looking.ranges)))
    for row, (joint, _) in enumerate(plan):
        sides[row, joint] = 1 - 2 * (row % 2)
    readings = np.array([at for _, at in plan])
    seen = looking.pixels(truth(readings, sides))
    noisy = seen + NOISE * rng.normal(size=seen.shape)
    read = readings + reading_noise * rng.normal(size=readings.shape)
    joints = [joint for joint, _ in plan]
    session = session_of_views(looking, zip(joints, read, strict=True), noisy, **keys)
    views = [
        view.model_copy(update={"approached": row.astype(int).tolist()})
        for view, row in zip(session.views, sides, strict=True)
    ]
    return session.with_views(views)


def squared_errors(calibration: Calibration, looking: LookingRig, truth: Truth, seed: int) -> np.ndarray:
    """Return squared errors of poses over their claimed covariances, a dimension, at readings all over the range."""
    rng = np.random.default_rng(seed)
    readings = looking.readings(rng, 40)
    sides = rng.choice([-1, 1], readings.shape)
    found = calibration.world_from_camera(readings, approached=sides)
    away = inverse(found) @ looking.rig.poses(truth(readings, sides))
    twists = np.concatenate([rotation_log(away), away[:, :3, 3]], axis=1)
    covariance = calibration.pose_covariance(readings, approached=sides)
    assert covariance is not None
    return (twists * np.linalg.solve(covariance, twists[..., None])[..., 0]).sum(axis=1) / 6


def test_backlash_is_found_where_its_sides_were_seen() -> None:
    looking = rig_of_three()
    session = both_ways(looking, backlash, 1)
    calibration = solve(session)
    (found,) = calibration.corrections.backlash
    assert found.joint == "j0"
    assert found.half_gap_std is not None
    assert found.half_gap == pytest.approx(0.03, abs=3 * found.half_gap_std)
    assert 0 < found.half_gap_std < 0.003
    assert not calibration.corrections.coupling
    assert not calibration.corrections.once_per_turn
    assert calibration.quality.held_out_rms_px == pytest.approx(NOISE * np.sqrt(2), rel=0.05)
    assert squared_errors(calibration, looking, backlash, 2).mean() < 3
    (sentence,) = calibration.quality.corrections
    assert "j0: backlash of 0.06" in sentence
    unseen = [view.model_copy(update={"approached": None}) for view in session.views]
    blind = solve(session.with_views(unseen))
    assert blind.corrections.model_dump() == {}
    other = both_ways(looking, backlash, 11)
    aware, unaware = verify(calibration, other).rms_px, verify(blind, other).rms_px
    assert aware is not None
    assert unaware is not None
    assert aware == pytest.approx(NOISE * np.sqrt(2), rel=0.05)
    assert unaware > 3 * aware


def test_a_once_per_turn_error_is_found() -> None:
    looking = rig_of_three()
    calibration = solve(both_ways(looking, eccentricity, 3))
    (found,) = calibration.corrections.once_per_turn
    assert found.joint == "j1"
    assert found.turn == pytest.approx(360, rel=0.06)
    assert not calibration.corrections.coupling
    assert calibration.quality.held_out_rms_px == pytest.approx(NOISE * np.sqrt(2), rel=0.05)
    assert squared_errors(calibration, looking, eccentricity, 4).mean() < 3


def test_coupling_is_found_on_the_joint_that_has_it() -> None:
    looking = rig_of_three()
    calibration = solve(both_ways(looking, coupling, 5))
    (found,) = calibration.corrections.coupling
    assert (found.joint, found.by) == ("j1", "j0")
    assert found.factor_std is not None
    assert found.factor == pytest.approx(0.01, abs=3 * found.factor_std)
    assert calibration.quality.held_out_rms_px == pytest.approx(NOISE * np.sqrt(2), rel=0.05)
    assert squared_errors(calibration, looking, coupling, 6).mean() < 3


def test_two_errors_at_once_are_both_found() -> None:
    looking = rig_of_three()
    calibration = solve(both_ways(looking, lambda v, s: coupling(v, s) + backlash(0 * v, s), 7))
    assert [one.joint for one in calibration.corrections.backlash] == ["j0"]
    assert [(one.joint, one.by) for one in calibration.corrections.coupling] == [("j1", "j0")]


def test_backlash_is_found_behind_noisy_readings() -> None:
    """What a correction explains is no noise: an unknown noise of readings does not swallow it."""
    calibration = solve(both_ways(rig_of_three(), lambda v, s: backlash(v, 3 * s), 8, reading_noise=0.03))
    (found,) = calibration.corrections.backlash
    assert found.joint == "j0"
    assert found.half_gap_std is not None
    assert found.half_gap == pytest.approx(0.09, abs=3 * found.half_gap_std)
    assert found.half_gap_std > 0.003


def test_backlash_is_found_among_knocked_views() -> None:
    session = both_ways(rig_of_three(), backlash, 9)
    views = list(session.views)
    for index in (3, 20, 41, 47):
        read = [reading + 2.0 for reading in views[index].readings]
        views[index] = views[index].model_copy(update={"readings": read})
    calibration = solve(session.with_views(views))
    aside = [int(w.split()[1]) for w in calibration.quality.warnings if "does not agree" in w]
    assert aside == [3, 20, 41, 47]
    assert [one.joint for one in calibration.corrections.backlash] == ["j0"]


@pytest.mark.parametrize("seed", range(12))
def test_perfect_joints_are_left_alone(seed: int) -> None:
    looking = looking_rig(np.random.default_rng(100 + seed), 2 + seed % 3)
    calibration = solve(both_ways(looking, lambda values, sides: values, seed))
    assert calibration.corrections.model_dump() == {}
    assert calibration.quality.corrections == []


def test_one_way_sweeps_say_nothing_of_backlash() -> None:
    looking = rig_of_three()
    session = noisy_session(looking, np.random.default_rng(10))
    one_way = [view.model_copy(update={"approached": [1, 1, 1]}) for view in session.views]
    assert solve(session.with_views(one_way)).corrections.model_dump() == {}
