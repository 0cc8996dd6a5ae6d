"""The commands that the pages show are commands that there are, with options that they have."""

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from daemon.cli.main import MODULES, command_line, main, spread_numbers
from tests.docs.pages import Block, blocks, page, pages

PAGE = "reference/command-line.md"
ROOT: Any = typer.main.get_command(command_line())


def _leaves(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    inner = getattr(command, "commands", None)
    if inner is None:
        yield name, command
        return
    for key, below in inner.items():
        yield from _leaves(below, f"{name} {key}")


COMMANDS = dict(_leaves(ROOT, "activecam"))


def _lines() -> Iterator[tuple[Block, str]]:
    for name in [*pages(), "../README.md"]:
        for block in (*blocks(name, "sh"), *blocks(name, "")):
            for line in block.text.splitlines():
                words = re.search(r"(?:^|\s|/)(activecam [a-z].*)", line.partition("  #")[0])
                if words:
                    yield block, re.split(r"  +| &$| \|", words[1])[0]


LINES = list(_lines())


@pytest.mark.parametrize(("block", "line"), LINES, ids=[f"{block}-{line}" for block, line in LINES])
def test_a_command_line_parses(block: Block, line: str) -> None:
    words = shlex.split(line.replace("[", "").replace("]", ""))
    context = ROOT.make_context("activecam", spread_numbers(words[1:]))
    command, name = ROOT, "activecam"
    rest = [*context._protected_args, *context.args]
    while hasattr(command, "commands"):
        name, command = f"{name} {rest[0]}", command.commands[rest[0]]
        rest = rest[1:]
    assert name in COMMANDS
    command.make_context(name, [word for word in rest if word != "|"], parent=None)


def test_every_command_has_its_heading_and_an_example() -> None:
    text = page(PAGE)
    headings = re.findall(r"^## (activecam .*)$", text, re.MULTILINE)
    assert sorted(headings) == sorted(COMMANDS)
    for name in COMMANDS:
        section = text.partition(f"\n## {name}\n")[2].partition("\n## ")[0]
        assert re.search(rf"```sh\n{name}", section), f"{PAGE} shows no example of {name}"


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_is_described(name: str) -> None:
    section = page(PAGE).partition(f"\n## {name}\n")[2].partition("\n## ")[0]
    for parameter in COMMANDS[name].params:
        for option in parameter.opts:
            if option.startswith("-") and option != "--help":
                assert option in section, f"{PAGE}: {name} has an option {option}"


def test_every_command_is_found_without_the_others() -> None:
    assert set(MODULES) == set(ROOT.commands)
    for name in MODULES:
        alone: Any = typer.main.get_command(command_line(name))
        assert name in alone.commands


def test_every_command_has_help_with_an_example() -> None:
    for name, command in COMMANDS.items():
        assert str(command.epilog).startswith(f"Example: {name}")


def test_pose_prints_what_the_page_shows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "calibration.json"
    file.write_text(next(b.text for b in blocks("reference/files.md", "json") if "calibration/1" in b.text))
    with pytest.raises(SystemExit) as ended:
        main(["pose", str(file), "--readings", "100", "90"])
    assert ended.value.code == 0
    [found] = json.loads(capsys.readouterr().out)["poses"]
    [shown] = json.loads(blocks(PAGE, "json")[0].text)["poses"]
    assert found.keys() == shown.keys()
    assert (found["readings"], found["std"]) == (shown["readings"], shown["std"])
    for key in ("world_from_camera", "base_from_camera"):
        np.testing.assert_allclose(found[key], shown[key], atol=1e-9)


def test_target_prints_what_the_page_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    section = page(PAGE).partition("\n## activecam target\n")[2]
    with pytest.raises(SystemExit) as ended:
        main(shlex.split(section.partition("```sh\n")[2].partition("\n")[0])[1:])
    assert ended.value.code == 0
    assert capsys.readouterr().out == section.partition("```toml\n")[2].partition("```")[0]
    assert (tmp_path / "target.pdf").exists()
