"""What `activecam solve` says of imperfect joints and targets, and `activecam pose` of the side of approach."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib import Calibration, load_calibration, save_calibration
from calib.corrections_in_words import FLAT
from daemon.cli.main import main
from tests.calib.scenes import DISK_CENTRES, DISKS, plan, points_session, two_axis_rig

PLAY = 0.04


@pytest.fixture
def session(tmp_path: Path) -> Path:
    """A session whose pan has play, and approaches its positions from either side."""
    rig, views = two_axis_rig(), []
    for view in plan():
        for side in (1, -1):
            moved = [side if view["joint"] == "slide" else 1, side if view["joint"] == "pan" else 1]
            slide, pan = view["readings"]
            views.append({**view, "readings": [slide, pan + PLAY / 2 * moved[1]], "approached": moved})
    target = {key: value for key, value in DISKS.items() if key != "disk_diameter"} | {"kind": "chessboard"}
    measured = points_session(rig, views, target, DISK_CENTRES).model_dump(exclude_unset=True)
    rng = np.random.default_rng(0)
    for view in measured["views"]:
        view["readings"][1] -= PLAY / 2 * view["approached"][1]
        pixels = np.array(view["points"]["pixels"])
        view["points"]["pixels"] = (pixels + 0.05 * rng.normal(size=pixels.shape)).tolist()
    file = tmp_path / "session.json"
    file.write_text(json.dumps(measured))
    return file


def run(*arguments: str) -> Any:
    with pytest.raises(SystemExit) as ended:
        main(list(arguments))
    return ended.value.code


@pytest.fixture
def calibration(session: Path, capsys: pytest.CaptureFixture[str]) -> Calibration:
    assert run("solve", str(session), "-o", str(session.with_name("c.json"))) == 0
    assert "pan: backlash of 0.0" in capsys.readouterr().out
    return load_calibration(session.with_name("c.json"))


def test_a_flat_target_is_said_to_be(session: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("solve", str(session), "-o", str(session.with_name("c.json")), "--target-warp") == 0
    assert FLAT in capsys.readouterr().out


def test_the_closed_form_bends_no_target(session: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("solve", str(session), "--method", "closed_form", "--target-warp") == 2
    assert "--target-warp: the closed form takes every target for flat" in capsys.readouterr().err


def test_a_pose_takes_the_side_of_approach(
    calibration: Calibration, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save_calibration(calibration, tmp_path / "c.json")
    poses = {}
    for sides in ([1, 1], [1, -1], [0, 0]):
        words = [str(side) for side in sides]
        assert run("pose", str(tmp_path / "c.json"), "--readings", "10", "-3", "--approached", *words) == 0
        poses[tuple(sides)] = json.loads(capsys.readouterr().out)["poses"][0]
        expected = calibration.world_from_camera([10.0, -3.0], approached=sides)
        assert np.allclose(poses[tuple(sides)]["world_from_camera"], expected, atol=1e-12)
    turned = [np.array(pose["world_from_camera"])[:3, :3] for pose in poses.values()]
    apart = np.degrees(np.arccos((np.trace(turned[0].T @ turned[1]) - 1) / 2))
    assert apart == pytest.approx(PLAY, rel=0.1)
    known, _, unknown = (np.linalg.norm(pose["std"]["rotation_rad"]) for pose in poses.values())
    assert np.sqrt(unknown**2 - known**2) == pytest.approx(np.radians(PLAY / 2), rel=0.2)


def test_sides_for_another_number_of_joints_are_a_wrong_call(
    calibration: Calibration, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save_calibration(calibration, tmp_path / "c.json")
    assert run("pose", str(tmp_path / "c.json"), "--readings", "10", "3", "--approached", "1") == 2
    assert "approached must be -1, 0 or 1 for each joint" in capsys.readouterr().err
