"""`activecam detect` looks at all pictures, says how good they are, and does not stop at a bad one."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib import save_calibration, solve
from daemon.cli.main import main
from tests.calib.detection.drawn_targets import draw
from tests.calib.test_partial_views import DISKS, NARROW_PAN, SLIDE, Rig

TABLE = """
[target]
kind = "chessboard"
rows = 6
columns = 9
pitch = "25 mm"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    from calib.targets import Chessboard

    board = Chessboard(rows=6, columns=9, pitch=0.025)
    (tmp_path / "board.toml").write_text(TABLE)
    for name, shift in (("left", -120), ("right", 120)):
        drawn = draw(board, tilt=(20, 10), fill=0.4, shift=(shift, 0), noise=1)
        cv2.imwrite(str(tmp_path / f"{name}.png"), drawn.picture)
    cv2.imwrite(str(tmp_path / "blurred.png"), draw(board, tilt=(20, 10), blur=4, noise=1).picture)
    few_photons = np.random.default_rng(1).poisson(draw(board, tilt=(20, 10)).picture / 80)
    cv2.imwrite(str(tmp_path / "dark.png"), few_photons.astype(np.uint8))
    (tmp_path / "empty.png").write_bytes(b"")
    return tmp_path


def run(folder: Path, *words: str) -> int:
    names = [str(folder / word) if word.endswith((".png", ".toml")) else word for word in words]
    with pytest.raises(SystemExit) as ended:
        main(["detect", *names])
    assert isinstance(ended.value.code, int)
    return ended.value.code


def test_pictures_are_judged_one_by_one_and_together(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(folder, "left.png", "right.png", "blurred.png", "--profile", "board.toml") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{folder / 'left.png'}: 54 of 54 points, edges 2.")
    assert lines[0].endswith("leaning 22 deg")
    assert lines[2].startswith(f"{folder / 'blurred.png'}: 54 of 54 points, edges ")
    said = re.match(r"  the picture is blurred: edges are ([\d.]+) px wide; focus", lines[3])
    assert said is not None
    assert float(said[1]) == pytest.approx(2.563 * 4, abs=1)
    assert len(lines) == 4
    assert run(folder, "left.png", "left.png", "--profile", "board.toml") == 0
    assert "together: no view shows the target in the upper left" in capsys.readouterr().out


def test_a_picture_without_the_target_is_told_and_the_others_are_looked_at(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(folder, "empty.png", "dark.png", "left.png", "none.png", "--profile", "board.toml") == 1
    empty, dark, left, none = capsys.readouterr().out.splitlines()
    assert empty == f"{folder / 'empty.png'}: the file is empty: copy or take the picture again"
    assert "too dark" in dark
    assert "54 of 54 points" in left
    assert "the picture is missing" in none


def test_json_has_all_points_and_figures(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = ["left.png", "right.png", "blurred.png", "empty.png"]
    assert run(folder, *names, "--profile", "board.toml", "--json") == 1
    document = json.loads(capsys.readouterr().out)
    left, _, blurred, empty = document["pictures"]
    assert left["found"]
    assert left["faults"] == []
    assert left["ids"] == list(range(54))
    assert np.shape(left["pixels"]) == (54, 2)
    assert left["health"]["target"]["of"] == 54
    assert [fault["kind"] for fault in blurred["faults"]] == ["blurred"]
    assert (empty["found"], empty["health"]) == (False, None)
    assert document["coverage"]["views"] == 3
    assert document["coverage"]["missing"] == []
    run(folder, "left.png", "--profile", "board.toml", "--json")
    assert json.loads(capsys.readouterr().out)["coverage"] is None


def test_a_shipped_profile_names_its_target(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(folder, "left.png", "--profile", "pan-tilt") == 1
    assert "ChArUco board" in capsys.readouterr().out


def test_a_file_without_a_target_is_refused_by_line(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "bad.toml").write_text(TABLE.replace('"25 mm"', "25"))
    assert run(folder, "left.png", "--profile", "bad.toml") == 1
    assert "bad.toml:6: target.pitch: " in capsys.readouterr().err
    (folder / "bad.toml").write_text("[camera]\n")
    assert run(folder, "left.png", "--profile", "bad.toml") == 1
    assert "target: is missing" in capsys.readouterr().err


def test_a_part_of_a_grid_is_found_where_a_calibration_has_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = Rig(tmp_path, DISKS)
    calibration = solve(rig.session([rig.view(view) for view in [*SLIDE, *NARROW_PAN]]))
    save_calibration(calibration, tmp_path / "rig.json")
    cv2.imwrite(str(tmp_path / "part.png"), rig.picture([50.0, -19.0]))
    (tmp_path / "disks.toml").write_text(
        '[target]\nkind = "circle_grid"\nrows = 4\ncolumns = 5\npitch = "30 mm"\ndisk_diameter = "18 mm"\n'
    )
    asked = ("part.png", "--profile", "disks.toml")
    knowing = (*asked, "--calibration", str(tmp_path / "rig.json"))
    assert run(tmp_path, *asked) == 1
    assert run(tmp_path, *knowing, "--readings", "50", "-19") == 0
    found = re.search(r"part.png: (\d+) of 20 points", capsys.readouterr().out)
    assert found is not None
    assert 8 <= int(found[1]) < 20
    # Elsewhere, where it would be wholly in the picture or not at all, it is not found.
    assert run(tmp_path, *knowing, "--readings", "50", "0") == 1
    assert run(tmp_path, *knowing, "--readings", "50", "150") == 1
    for wrong in (
        knowing,
        (*asked, "--readings", "50", "-19"),
        ("part.png", *knowing, "--readings", "50", "-19"),
    ):
        assert run(tmp_path, *wrong) == 2
