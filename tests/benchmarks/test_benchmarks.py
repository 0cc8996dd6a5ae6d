"""Every benchmark runs to its end at its smallest size, and prints finite figures."""

import math
import os
import re
from pathlib import Path

import cv2
import pytest

from benchmarks import command
from benchmarks.chromium import CHROMIUM


@pytest.fixture(autouse=True)
def _threads_as_before():
    threads = cv2.getNumThreads()
    yield
    cv2.setNumThreads(threads)


@pytest.mark.parametrize("name", command.NAMES)
def test_a_benchmark_prints_finite_figures(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    if name == "page" and not Path(CHROMIUM).exists() and not os.environ.get("CI"):
        pytest.skip("chromium is not installed")
    figures = command.run(name, quick=True)
    printed = capsys.readouterr().out
    assert figures
    assert all(math.isfinite(figure) and figure > 0 for figure in figures.values())
    assert name in printed
    assert not re.search(r"\bnan\b", printed)


def test_list_says_what_each_benchmark_measures(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(["--list"]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in printed] == list(command.NAMES)
    assert all(len(line.split()) > 5 for line in printed)


def test_a_benchmark_that_does_not_exist_is_a_wrong_call(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        command.main(["solve_tim"])
    assert ended.value.code == 2
    assert "solve_time" in capsys.readouterr().err
