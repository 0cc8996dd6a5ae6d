"""Sessions that were not taken joint by joint start from a drawing, which also says how far it may be wrong."""

from typing import Any

import numpy as np
import pytest

from calib import Calibration, load_session, solve
from calib.errors import UnsolvableError
from calib.session import SESSION_FORMAT, Session
from calib.transforms import pose_error
from calib.twists import exp_twist
from tests.data import real

DRAWING = [
    {"a": 0.1, "alpha": np.pi / 2, "d": 0.4, "theta": 0.2, "scale": 1.0},
    {"a": 0.35, "alpha": 0.1, "d": 0.02, "theta": -0.3, "scale": 1.0},
    {"a": 0.05, "alpha": -np.pi / 2, "d": 0.1, "theta": 0.5, "scale": 1.0},
]
STD = {"length": 0.003, "angle": 0.01, "scale": 0.002}
RNG = np.random.default_rng(2)
BASE, MOUNT = exp_twist(RNG.normal(size=6)), exp_twist(0.5 * RNG.normal(size=6))


def link(convention: str, row: dict[str, float], reading: float) -> np.ndarray:
    """Return a D-H link, by its definition in four elementary motions."""
    theta = row["theta"] + row["scale"] * reading
    cos_t, sin_t, cos_a, sin_a = np.cos(theta), np.sin(theta), np.cos(row["alpha"]), np.sin(row["alpha"])
    turn = np.array([[cos_t, -sin_t, 0, 0], [sin_t, cos_t, 0, 0], [0, 0, 1, row["d"]], [0, 0, 0, 1]])
    twist = np.array([[1, 0, 0, row["a"]], [0, cos_a, -sin_a, 0], [0, sin_a, cos_a, 0], [0, 0, 0, 1]])
    return turn @ twist if convention == "standard_dh" else twist @ turn


def true_pose(convention: str, rows: list[dict[str, float]], readings: np.ndarray) -> np.ndarray:
    pose = BASE
    for row, reading in zip(rows, readings, strict=True):
        pose = pose @ link(convention, row, reading)
    return pose @ MOUNT


def free_session(
    convention: str, rows: list[dict[str, float]], views: np.ndarray, noise: float = 0.0
) -> Session:
    poses = [true_pose(convention, rows, at) @ exp_twist(noise * RNG.normal(size=6)) for at in views]
    document: dict[str, Any] = {
        "format": SESSION_FORMAT,
        "joints": [{"name": f"j{i}", "kind": "revolute", "reading_unit": "rad"} for i in range(len(rows))],
        "cameras": [{"name": "main"}],
        "target": {"kind": "none"},
        "nominal": {"convention": convention, "dh": DRAWING, "std": STD},
        "views": [
            {"joint": None, "readings": at.tolist(), "world_from_camera": pose.tolist()}
            for at, pose in zip(views, poses, strict=True)
        ],
    }
    return Session.model_validate(document)


def as_built() -> list[dict[str, float]]:
    """Return the drawing with errors as large as it says."""
    sizes = {
        "a": STD["length"],
        "d": STD["length"],
        "alpha": STD["angle"],
        "theta": STD["angle"],
        "scale": STD["scale"],
    }
    return [{key: value + sizes[key] * RNG.normal() for key, value in row.items()} for row in DRAWING]


def errors(calibration: Calibration, convention: str, rows: list[dict[str, float]]) -> tuple[float, float]:
    readings = RNG.uniform(-1, 1, (30, len(rows)))
    true = np.array([true_pose(convention, rows, at) for at in readings])
    distance, angle = pose_error(calibration.world_from_camera(readings), true)
    return float(distance.mean()), float(angle.mean())


@pytest.mark.parametrize("convention", ["standard_dh", "modified_dh"])
def test_a_right_drawing_is_placed_exactly(convention: str) -> None:
    calibration = solve(free_session(convention, DRAWING, RNG.uniform(-1, 1, (12, 3))))
    assert max(errors(calibration, convention, DRAWING)) < 1e-7
    if convention == "standard_dh":
        assert np.allclose(calibration.world_from_base, BASE, atol=1e-6)


@pytest.mark.parametrize("convention", ["standard_dh", "modified_dh"])
def test_free_views_mend_the_drawing(convention: str) -> None:
    rows = as_built()
    session = free_session(convention, rows, RNG.uniform(-1, 1, (40, 3)), noise=2e-4)
    calibration = solve(session)
    distance, angle = errors(calibration, convention, rows)
    assert distance < 4e-4
    assert angle < 4e-4


def test_a_joint_that_hardly_moved_stays_where_the_drawing_has_it() -> None:
    rows = as_built()
    views = RNG.uniform(-1, 1, (30, 3)) * [1, 1, 1e-3]
    calibration = solve(free_session("standard_dh", rows, views, noise=2e-4))
    assert calibration.joints[2].scale == pytest.approx(DRAWING[2]["scale"], abs=4 * STD["scale"])
    assert calibration.joints[2].scale_std == pytest.approx(STD["scale"], rel=0.2)
    drawn = solve(free_session("standard_dh", DRAWING, RNG.uniform(-1, 1, (12, 3)))).joints[2]
    assert np.degrees(np.arccos(np.dot(calibration.joints[2].axis, drawn.axis))) < 4


def test_too_few_views_are_refused() -> None:
    with pytest.raises(UnsolvableError, match="needs 3 views or more"):
        solve(free_session("standard_dh", DRAWING, RNG.uniform(-1, 1, (2, 3))))


def test_views_that_turn_one_way_only_are_refused() -> None:
    views = RNG.uniform(-1, 1, (12, 3)) * [1, 0, 0]
    with pytest.raises(UnsolvableError, match="about one direction only"):
        solve(free_session("standard_dh", DRAWING, views))


def test_the_real_arm_is_predicted_better_than_its_drawing() -> None:
    quality = solve(load_session(real("nachi0117"))).quality
    assert quality.rms_px is not None
    assert quality.rms_px < 0.6
    assert quality.held_out_rms_px is not None
    assert quality.held_out_rms_px < 0.75
