"""Corrections in a calibration: written and read, applied to the readings, and carried into the pose's covariance."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib import Calibration, load_calibration, save_calibration
from calib.calibration import CALIBRATION_FORMAT
from calib.errors import FormatError, ReadingsError
from calib.stated_parameters import stated_parameters
from calib.transforms import inverse, rotation_log
from tests.calib.scenes import two_axis_rig

RIG = two_axis_rig()
CORRECTIONS: dict[str, Any] = {
    "backlash": [{"joint": "pan", "half_gap": 0.02}],
    "once_per_turn": [{"joint": "pan", "turn": 360.0, "cosine": 0.05, "sine": -0.03}],
    "coupling": [{"joint": "slide", "by": "pan", "factor": 0.004}],
}
COEFFICIENTS = {
    "corrections.backlash.0.half_gap": 0.02,
    "corrections.once_per_turn.0.cosine": 0.05,
    "corrections.once_per_turn.0.sine": -0.03,
    "corrections.coupling.0.factor": 0.004,
}
SIDES = np.array([[0, 1], [1, -1], [0, 1]])
READINGS = np.array([[30.0, 80.0], [-20.0, -140.0], [5.0, 200.0]])


def document(**keys: Any) -> dict[str, Any]:
    joints = [
        {
            "name": name,
            "kind": kind,
            "reading_unit": unit,
            "scale": scale,
            "axis": axis.tolist(),
            "point": point.tolist(),
        }
        for name, kind, unit, scale, axis, point in zip(
            ["slide", "pan"], RIG.kinds, ["mm", "deg"], RIG.scales, RIG.axes, RIG.points, strict=True
        )
    ]
    row = {"a_prev": 0.0, "alpha_prev": 0.0, "d_offset": 0.0, "theta_offset": 0.0, "scale": 1.0}
    camera = {"name": "main", "link": "pan", "link_from_camera": None, "intrinsics": None}
    return {
        "format": CALIBRATION_FORMAT,
        "method": "ml",
        "joints": joints,
        "dh": [row, row],
        "world_from_base": np.eye(4).tolist(),
        "cameras": [{**camera, "world_from_camera": RIG.mount.tolist()}],
        "range": [[-100, 100], [-180, 180]],
        "quality": {},
    } | keys


def calibration(**keys: Any) -> Calibration:
    return Calibration.model_validate(document(**keys))


def corrected(readings: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """Return what the joints do, by formulas of this file's own."""
    angle = np.radians(readings[:, 1])
    pan = readings[:, 1] + 0.02 * sides[:, 1] + 0.05 * (np.cos(angle) - 1) - 0.03 * np.sin(angle)
    return np.column_stack([readings[:, 0] + 0.004 * readings[:, 1], pan])


def test_they_are_among_the_parameters_by_the_names_of_joints_and_with_their_units() -> None:
    stds = {"half_gap_std": 0.001}
    stated = {
        **CORRECTIONS,
        "backlash": [CORRECTIONS["backlash"][0] | stds],
        "target_warp": {"shapes": ["xx"], "heights": [0.0004], "heights_std": [0.00002]},
        "aspect": [{"camera": "main", "aspect": 0.002}],
    }
    ideal = {each.name for each in stated_parameters(calibration())}
    found = [each for each in stated_parameters(calibration(corrections=stated)) if each.name not in ideal]
    assert [(each.name, each.value, each.std, each.unit) for each in found] == [
        ("pan.half_gap", 0.02, 0.001, "deg"),
        ("pan.once_per_turn.cosine", 0.05, None, "deg"),
        ("pan.once_per_turn.sine", -0.03, None, "deg"),
        ("slide.coupling.pan", 0.004, None, "mm/deg"),
        ("target.warp.xx", 0.0004, 0.00002, "m"),
        ("main.aspect", 0.002, None, ""),
    ]


def twists(poses: np.ndarray, at: np.ndarray) -> np.ndarray:
    away = inverse(at) @ poses
    return np.concatenate([rotation_log(away), away[..., :3, 3]], axis=-1)


def test_poses_are_those_of_the_corrected_readings() -> None:
    found = calibration(corrections=CORRECTIONS).world_from_camera(READINGS, approached=SIDES)
    assert np.allclose(found, [RIG.pose(at) for at in corrected(READINGS, SIDES)], atol=1e-12)
    one = calibration(corrections=CORRECTIONS).world_from_camera(READINGS[1], approached=SIDES[1])
    assert np.allclose(one, found[1], atol=1e-15)


def test_an_unknown_side_is_taken_at_the_middle() -> None:
    rig = calibration(corrections=CORRECTIONS)
    middle = rig.world_from_camera(READINGS)
    assert np.allclose(middle, [RIG.pose(at) for at in corrected(READINGS, 0 * SIDES)], atol=1e-12)
    assert np.allclose(middle, rig.world_from_camera(READINGS, approached=[0, 0]))


def with_covariance(matrix: np.ndarray) -> Calibration:
    covariance = {"parameters": list(COEFFICIENTS), "matrix": matrix.tolist()}
    return calibration(corrections=CORRECTIONS, covariance=covariance)


def test_an_unknown_side_widens_the_pose_by_the_variance_of_two_points() -> None:
    rig = with_covariance(np.zeros((4, 4)))
    assert np.allclose(rig.pose_covariance(READINGS, approached=SIDES), 0)
    found = rig.pose_covariance(READINGS)
    assert found is not None
    middle = rig.world_from_camera(READINGS)
    ends = [twists(rig.world_from_camera(READINGS, approached=[0, side]), middle) for side in (-1, 1)]
    expected = sum(end[:, :, None] * end[:, None, :] for end in ends) / 2
    assert np.allclose(found, expected, rtol=1e-3, atol=1e-15)


def test_unsure_readings_widen_the_pose_as_they_move_it() -> None:
    rig, std = with_covariance(np.zeros((4, 4))), np.abs(READINGS) * 1e-4 + np.array([0.1, 0.02])
    found = rig.pose_covariance(READINGS, approached=SIDES, reading_std=std)
    at = rig.world_from_camera(READINGS, approached=SIDES)
    expected = 0
    for joint in (0, 1):
        off = np.zeros_like(std)
        off[:, joint] = 1e-3 * std[:, joint]
        moved = 1e3 * twists(rig.world_from_camera(READINGS + off, approached=SIDES), at)
        expected = expected + moved[:, :, None] * moved[:, None, :]
    # The corrections are taken as they are at the reading itself, which is off by parts in a thousand.
    size = np.sqrt(np.diagonal(found, axis1=1, axis2=2))
    assert (np.abs(found - expected) <= 0.01 * size[:, :, None] * size[:, None, :] + 1e-9 * size.max()).all()
    beside = rig.pose_covariance(READINGS, reading_std=std)
    assert np.allclose(beside, found + rig.pose_covariance(READINGS))


def test_the_coefficients_covariance_reaches_the_pose() -> None:
    rng = np.random.default_rng(0)
    root = 1e-3 * rng.normal(size=(4, 4)) * np.array([1, 1, 1, 0.1])[:, None]
    claimed = with_covariance(root @ root.T).pose_covariance(READINGS, approached=SIDES)
    assert claimed is not None
    at = with_covariance(root @ root.T).world_from_camera(READINGS, approached=SIDES)
    drawn = []
    for off in rng.normal(size=(3000, 4)) @ root.T:
        gap, cosine, sine, factor = np.array(list(COEFFICIENTS.values())) + off
        changed = {
            "backlash": [{"joint": "pan", "half_gap": gap}],
            "once_per_turn": [{"joint": "pan", "turn": 360.0, "cosine": cosine, "sine": sine}],
            "coupling": [{"joint": "slide", "by": "pan", "factor": factor}],
        }
        poses = calibration(corrections=changed).world_from_camera(READINGS, approached=SIDES)
        drawn.append(twists(poses, at))
    sampled = np.einsum("nki,nkj->kij", drawn, drawn) / len(drawn)
    size = np.sqrt(np.diagonal(claimed, axis1=1, axis2=2))
    assert np.allclose(sampled, claimed, atol=0.1 * (size[:, :, None] * size[:, None, :]).max())


def test_what_is_stated_survives_writing_and_reading(tmp_path: Path) -> None:
    written = calibration(corrections={**CORRECTIONS, "creep": 3})
    save_calibration(written, tmp_path / "calibration.json")
    read = load_calibration(tmp_path / "calibration.json")
    assert read.corrections.model_dump() == written.corrections.model_dump()
    assert read.corrections.model_dump()["creep"] == 3
    assert np.allclose(read.world_from_camera(READINGS), written.world_from_camera(READINGS), atol=1e-15)


def test_nothing_corrected_is_written_as_nothing(tmp_path: Path) -> None:
    save_calibration(calibration(corrections={}), tmp_path / "calibration.json")
    assert '"corrections": {}' in (tmp_path / "calibration.json").read_text()


def test_a_joint_that_is_not_there_is_refused(tmp_path: Path) -> None:
    wrong = {"coupling": [{"joint": "pan", "by": "tilt", "factor": 0.1}]}
    (tmp_path / "calibration.json").write_text(json.dumps(document(corrections=wrong)))
    with pytest.raises(FormatError, match="corrections: 'tilt' is not a joint of this calibration"):
        load_calibration(tmp_path / "calibration.json")


@pytest.mark.parametrize("sides", [[1], [2, 0], [[1, 0]]])
def test_sides_that_make_no_sense_are_refused(sides: Any) -> None:
    with pytest.raises(ReadingsError, match="approached must be -1, 0 or 1"):
        calibration().world_from_camera(READINGS, approached=sides)
