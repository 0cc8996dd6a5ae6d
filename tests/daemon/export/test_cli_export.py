"""`activecam export`: files from a file, and sentences where there can be none."""

import json
from pathlib import Path
from typing import Any

import pytest

from calib import save_calibration
from daemon.cli.main import main
from daemon.export import EXPORTS
from tests.daemon.export.subjects import calibration_of, with_lens


def run(*arguments: str) -> Any:
    with pytest.raises(SystemExit) as ended:
        main(["export", *arguments])
    return ended.value.code


@pytest.fixture
def calibration(tmp_path: Path) -> Path:
    """A calibration in its session's folder, as a run leaves it."""
    folder = tmp_path / "monday"
    folder.mkdir()
    (folder / "session.json").write_text("{}")
    save_calibration(with_lens(calibration_of("paper-table")), folder / "calibration.json")
    return folder / "calibration.json"


def test_all_of_it_lands_in_the_folder(
    calibration: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(str(calibration), "--all", "-o", str(tmp_path / "out")) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(
        export.name for export in EXPORTS
    )
    for export in EXPORTS:
        assert f"{export.name}: {export.purpose}" in out
    assert (tmp_path / "out" / "calibration.json").read_bytes() == calibration.read_bytes()


def test_one_that_cannot_be_had_ends_it_with_a_sentence_and_leaves_nothing(
    calibration: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    calibration.with_name("session.json").unlink()
    assert run(str(calibration), "session.zip", "-o", str(tmp_path / "out")) == 1
    assert "there is no session.json in 'monday'" in capsys.readouterr().err
    assert list((tmp_path / "out").iterdir()) == []


def test_all_leaves_out_what_cannot_be_had_and_says_so(
    calibration: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("daemon.export.catalogue.made_apart", lambda *_: b"a report, which takes seconds")
    calibration.with_name("session.json").unlink()
    assert run(str(calibration), "--all", "-o", str(tmp_path / "out")) == 0
    assert "session.zip is left out: there is no session.json" in capsys.readouterr().err
    assert not (tmp_path / "out" / "session.zip").exists()
    assert (tmp_path / "out" / "rig.urdf").exists()


def test_what_a_format_leaves_out_is_a_warning(
    calibration: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = json.loads(calibration.read_text())
    document["corrections"] = {"backlash": [{"joint": "pan", "half_gap": 0.01}]}
    calibration.write_text(json.dumps(document))
    assert run(str(calibration), "rig.urdf", "-o", str(tmp_path)) == 0
    assert "warning: rig.urdf: a URDF knows no backlash: 'pan'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "give names, of report.pdf"),
        (["--all", "rig.urdf"], "give names, of report.pdf"),
        (["rig.usd"], "there is no export 'rig.usd'; there are report.pdf"),
    ],
)
def test_a_wrong_call_is_one(
    arguments: list[str], says: str, calibration: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(str(calibration), *arguments) == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"format": "activecam.session/1"}', '{"format": "activecam.calibration/1"}']
)
def test_a_damaged_calibration_is_named_and_nothing_is_written(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "calibration.json"
    file.write_text(text)
    assert run(str(file), "--all", "-o", str(tmp_path / "out")) == 1
    assert capsys.readouterr().err.startswith(f"activecam: {file}")
    assert not (tmp_path / "out").exists()
