"""`activecam solve` holds what it is told to, and says what it cannot."""

import json
from pathlib import Path

import numpy as np
import pytest

from daemon.cli.main import main
from tests.calib.scenes import DISK_CENTRES, DISKS, plan, points_session, two_axis_rig


@pytest.fixture
def session(tmp_path: Path) -> Path:
    target = {key: value for key, value in DISKS.items() if key != "disk_diameter"} | {"kind": "chessboard"}
    measured = points_session(two_axis_rig(), plan(), target, DISK_CENTRES)
    file = tmp_path / "session.json"
    file.write_text(measured.model_dump_json(exclude_unset=True))
    return file


def test_what_is_held_is_in_the_result_and_not_in_the_session(
    session: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = session.read_text()
    axis = two_axis_rig().axes[1]
    hold = ["pan.scale", "slide.scale=0.001", "main.aspect", f"pan.axis={','.join(map(str, 2 * axis))}"]
    options = [word for name in hold for word in ("--hold", name)]
    with pytest.raises(SystemExit) as ended:
        main(["solve", str(session), "-o", str(session.with_name("c.json")), "--json", *options])
    assert ended.value.code == 0
    found = json.loads(capsys.readouterr().out)
    slide, pan = found["joints"]
    assert (slide["scale"], slide["scale_std"]) == (0.001, 0.0)
    assert pan["scale"] == pytest.approx(0.017453292519943295, rel=1e-15)
    assert pan["axis"] == pytest.approx(axis.tolist(), abs=1e-15)
    assert found["cameras"][0]["intrinsics"]["fx"] == found["cameras"][0]["intrinsics"]["fy"]
    assert found["held"] == {
        "pan.scale": pan["scale"],
        "slide.scale": 0.001,
        "main.aspect": 1.0,
        "pan.axis": pytest.approx((2 * axis).tolist()),
    }
    assert session.read_text() == before


def test_what_is_held_is_printed(session: Path, capsys: pytest.CaptureFixture[str]) -> None:
    hold = ["--hold", "slide.scale", "--hold", "pan.axis=0.02,0.9,-0.5", "--method", "closed_form"]
    with pytest.raises(SystemExit):
        main(["solve", str(session), "-o", str(session.with_name("c.json")), *hold])
    assert "Held, not found: slide.scale at 0.001, pan.axis at 0.02,0.9,-0.5" in capsys.readouterr().out


def test_views_are_left_out_of_the_result_and_not_of_the_session(
    session: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = session.read_text()
    left_out = ["--leave-out", "3", "--leave-out", "12"]
    with pytest.raises(SystemExit) as ended:
        main(["solve", str(session), "-o", str(session.with_name("c.json")), "--json", *left_out])
    assert ended.value.code == 0
    quality = json.loads(capsys.readouterr().out)["quality"]
    assert [view["view"] for view in quality["views"] if view["use"] == "none"] == [3, 12]
    assert [joint["views"] for joint in quality["joints"]] == [8, 8]
    assert "2 views left out by hand" in quality["verdict"]
    assert session.read_text() == before
    with pytest.raises(SystemExit) as refused:
        main(["solve", str(session), "--leave-out", "18"])
    assert refused.value.code == 2
    assert "there is no view 18" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("hold", "says"),
    [
        (
            "pam.scale",
            "there is no parameter 'pam.scale' to hold; there are slide.scale, slide.axis, pan.scale",
        ),
        ("pan.scale=x", "--hold pan.scale=x: 'x' is not a number, nor three with commas between them"),
        ("pan.scale=", "--hold pan.scale=: '' is not a number"),
        ("pan.axis=1,2", "must be a number, three numbers, or null"),
        ("pan.scale=nan", "must be a number, three numbers, or null"),
    ],
)
def test_what_cannot_be_held_is_a_wrong_call(
    session: Path, capsys: pytest.CaptureFixture[str], hold: str, says: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["solve", str(session), "--hold", hold])
    assert ended.value.code == 2
    assert says in capsys.readouterr().err


def test_it_ends_with_the_verdict_after_tables_by_joint_and_by_view(
    session: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = json.loads(session.read_text())
    rng = np.random.default_rng(0)
    for view in document["views"]:
        pixels = np.array(view["points"]["pixels"])
        view["points"]["pixels"] = (pixels + 0.01 * rng.normal(size=pixels.shape)).tolist()
    session.write_text(json.dumps(document))
    with pytest.raises(SystemExit) as ended:
        main(["solve", str(session), "-o", str(session.with_name("c.json"))])
    assert ended.value.code == 0
    printed = capsys.readouterr().out
    quality = json.loads(session.with_name("c.json").read_text())["quality"]
    assert quality["verdict"] in printed
    [covered] = quality["coverage"]
    assert covered["views"] == len(quality["views"])
    assert f"main: views cover X {100 * covered['x']:.0f} %" in printed
    assert covered["missing"]
    assert all(sentence in printed for sentence in covered["missing"])
    by_joint, by_view = printed.split("Views by joint")[1].split("The worst views")
    for row in quality["joints"]:
        cells = next(line for line in by_joint.splitlines() if row["joint"] in line).split("│")
        assert cells[2].strip() == str(row["views"])
        assert cells[4].strip() == f"{row['held_out_px']:.3f}"
    worst = max(quality["views"], key=lambda view: view["held_out_px"])
    first = next(line for line in by_view.splitlines() if line.startswith("│"))
    assert first.split("│")[1].strip() == str(worst["view"])
