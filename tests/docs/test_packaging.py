"""The unit and the image start a daemon that there is, as somebody who may do little."""

import configparser
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import typer

from daemon.api.rules import PREFIX, ROLES
from daemon.cli.main import command_line

ROOT = Path(__file__).parents[2]
UNIT = ROOT / "packaging" / "activecam.service"
COMMAND: Any = typer.main.get_command(command_line())


def parses(words: list[str]) -> dict[str, Any]:
    """Return what the command line makes of the words after `activecam`."""
    command = COMMAND.commands[words[0]]
    return dict(command.make_context(words[0], words[1:]).params)


def service() -> configparser.SectionProxy:
    unit = configparser.ConfigParser(strict=False, interpolation=None)
    unit.optionxform = str  # type: ignore[assignment,method-assign]
    unit.read(UNIT, encoding="utf-8")
    return unit["Service"]


def test_the_unit_serves_with_a_watchdog_and_little_power() -> None:
    unit = service()
    program, *words = shlex.split(unit["ExecStart"])
    assert program.endswith("/bin/activecam")
    assert str(parses(words)["data"]) == f"/var/lib/{unit['StateDirectory']}"
    assert unit["Type"] == "notify"
    assert float(unit["WatchdogSec"]) > 0
    assert unit["Restart"] == "on-failure"
    assert unit["DynamicUser"] == "yes"
    assert set(unit["SupplementaryGroups"].split()) == {"dialout", "video"}


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd is not installed")
def test_systemd_finds_nothing_wrong_with_the_unit(tmp_path: Path) -> None:
    copy = tmp_path / UNIT.name  # with a program that is there
    copy.write_text(UNIT.read_text(encoding="utf-8").replace("/opt/activecam/bin/activecam", sys.executable))
    verified = subprocess.run(
        ["systemd-analyze", "verify", str(copy)], capture_output=True, text=True, check=False
    )
    assert (verified.returncode, verified.stderr) == (0, "")


def instructions() -> list[tuple[str, str]]:
    """Return the Dockerfile's instructions, each with its arguments on one line."""
    text = re.sub(r"\\\n\s*", "", (ROOT / "Dockerfile").read_text(encoding="utf-8"))
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return [(word, rest) for word, _, rest in (line.partition(" ") for line in lines)]


def test_the_image_is_of_what_is_here_and_runs_as_nobody_special() -> None:
    found = instructions()
    assert {rest.split()[0] for word, rest in found if word == "FROM"} == {"python:3.13-slim"}
    copied = " ".join(rest for word, rest in found if word == "COPY").split()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert set(project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]) <= set(copied)
    kept = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    for word, rest in found:
        if word == "COPY" and not rest.startswith("--from"):
            for name in rest.split()[:-1]:
                assert (ROOT / name).exists()
                assert f"!{name}" in kept
    last = dict(found[max(i for i, (word, _) in enumerate(found) if word == "FROM") :])
    assert last["USER"] not in {"root", "0"}
    assert last["VOLUME"] == "/var/lib/activecam"
    assert last["ENTRYPOINT"] == '["activecam"]'
    assert str(parses(shlex.split(last["CMD"].strip("[]").replace(",", " ")))["data"]) == last["VOLUME"]


def test_the_image_asks_for_its_health_where_no_key_is_needed() -> None:
    [check] = [rest for word, rest in instructions() if word == "HEALTHCHECK"]
    asked = re.search(r"http://127\.0\.0\.1:8080(/[\w/]+)", check)
    assert asked is not None
    assert ROLES[f"GET {asked[1].removeprefix(PREFIX)}"] is None
