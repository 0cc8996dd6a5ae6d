"""A daemon of its own for the examples on a page."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.daemon.rigs import write_profile


@pytest.fixture
def served(tmp_path: Path) -> Iterator[str]:
    """The address of a daemon of its own, on a small rig whose axes are called as those on the page."""
    command = [sys.executable, "-c", "from daemon.cli import main; main()", "serve", "--port", "0"]
    command += ["--profile", str(write_profile(tmp_path)), "--data", str(tmp_path / "data")]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
    ) as process:
        assert process.stdout is not None
        try:
            found = re.search(r"http://[\w.:]+", process.stdout.readline())
            assert found is not None
            yield found[0]
        finally:
            process.terminate()
            process.communicate()
    assert process.returncode == 0
