"""`activecam target` draws what its options or a profile describe, and prints the profile's table for it."""

import tomllib
from pathlib import Path

import pytest

from daemon.cli.main import main
from daemon.profile import load_profile

CHARUCO = "--kind charuco --rows 7 --columns 5 --pitch 30mm --marker 2.2cm --dictionary DICT_5X5_100"
BEGINNINGS = {".pdf": b"%PDF-", ".svg": b"<?xml", ".png": b"\x89PNG"}


def run(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(["target", *map(str, arguments)])
    printed = capsys.readouterr()
    assert isinstance(ended.value.code, int)
    return ended.value.code, printed.out, printed.err


@pytest.mark.parametrize("ending", [".pdf", ".svg", ".png", ".PDF"])
def test_the_ending_says_what_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], ending: str
) -> None:
    file = tmp_path / f"board{ending}"
    assert run(capsys, *CHARUCO.split(), "-o", file)[0] == 0
    assert file.read_bytes().startswith(BEGINNINGS[ending.lower()])


@pytest.mark.parametrize(
    "options",
    [
        CHARUCO,
        "--kind circle_grid --rows 5 --columns 4 --pitch 22.1mm --disk-diameter 1e-2m",
        "--kind asymmetric_circle_grid --rows 5 --columns 4 --pitch 0.03m --disk-diameter 12mm",
        "--kind chessboard --rows 5 --columns 4 --pitch 0.7in",
        "--kind aprilgrid --rows 5 --columns 4 --tag 30mm --spacing 9mm --paper Letter --margin 5mm",
    ],
)
def test_the_table_that_is_printed_is_pasted_into_a_profile_and_drawn_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: str
) -> None:
    drawn, again = tmp_path / "drawn.svg", tmp_path / "again.svg"
    status, table, _ = run(capsys, *options.split(), "-o", drawn)
    assert status == 0
    text = Path("hw_profiles/paper-table.toml").read_text(encoding="utf-8")
    document = text.split("[target]")
    rest = document[1][document[1].index("\n[") :]
    profile = tmp_path / "rig.toml"
    profile.write_text(document[0] + table + rest, encoding="utf-8")

    paper = options.partition(" --paper")[1] + options.partition(" --paper")[2]
    status, printed, _ = run(capsys, "--like", profile, "-o", again, *paper.split())
    assert status == 0
    assert again.read_bytes() == drawn.read_bytes()
    assert tomllib.loads(printed) == tomllib.loads(table)


def test_a_shipped_profiles_target_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, table, _ = run(capsys, "--like", "paper-table", "-o", tmp_path / "t.png", "--dpi", "50")
    assert status == 0
    [target] = tomllib.loads(table).values()
    assert target["kind"] == "circle_grid"
    assert target["pitch"] == f"{1000 * load_profile('paper-table').target.pitch:g} mm"


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ("", "give either --like PROFILE, or --kind and the target's own options"),
        ("--like paper-table --rows 3", "give either --like PROFILE, or --kind"),
        ("--rows 3", "--kind is missing"),
        ("--kind dots", "--kind must be one of 'circle_grid', 'asymmetric_circle_grid', 'chessboard'"),
        ("--kind chessboard --rows 3 --pitch 3mm", "--columns is missing; see"),
        ("--kind chessboard --rows 3 --columns 3 --pitch 3", "--pitch: '3' has no unit: write a length"),
        ("--kind chessboard --rows 1 --columns 3 --pitch 3mm", "--rows: must be greater than or equal to 3"),
        (
            "--kind chessboard --rows 3 --columns 3 --pitch 3mm --tag 1mm",
            "--tag is not for a target of the kind chessboard",
        ),
        (
            "--kind circle_grid --rows 3 --columns 3 --pitch 3mm --disk-diameter 4mm",
            "disk_diameter (0.004 m) must be smaller than pitch (0.003 m)",
        ),
        (CHARUCO + " -o t.gif", "--output t.gif: its ending must be one of .pdf, .svg, .png"),
        (CHARUCO + " -o t.pdf --dpi 300", "--dpi is for a PNG, and t.pdf has no pixels"),
        (CHARUCO + " -o t.png --dpi 0", "'--dpi'"),
        (CHARUCO + " --margin -1mm", "--margin must not be negative"),
        (CHARUCO + " --margin 10", "'10' has no unit"),
        (CHARUCO + " --paper A9", "'A9' is no paper"),
    ],
)
def test_wrong_calls_are_told_in_a_sentence(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    options: str,
    says: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    status, printed, told = run(capsys, *options.split())
    assert (status, printed) == (2, "")
    assert says in told
    assert told.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (CHARUCO + " --paper 100x100mm", "the charuco does not fit on 100x100mm with its white rim"),
        (CHARUCO + " -o t.png --dpi 5000", "pixels: choose another --dpi, or a PDF"),
        (CHARUCO + " -o nowhere/t.pdf", "nowhere/t.pdf: No such file or directory"),
        ("--like nowhere.toml", "nowhere.toml"),
    ],
)
def test_what_could_not_be_done_is_told_in_a_sentence(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    options: str,
    says: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    status, printed, told = run(capsys, *options.split())
    assert (status, printed) == (1, "")
    assert says in told
    assert told.count("\n") == 1
