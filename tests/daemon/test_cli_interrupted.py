"""Who presses Ctrl-C is answered with a word, however early it is."""

import subprocess
import sys

import pytest

INTERRUPTED_WHILE = """
import sys

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == sys.argv[1]:
            raise KeyboardInterrupt

sys.meta_path.insert(0, Finder())
from daemon.cli import main
main(["serve", "--profile", "paper-table"])
"""


@pytest.mark.parametrize("loading", ["typer", "numpy", "daemon.cli.serve", "uvicorn"])
def test_an_interrupt_while_it_is_still_loading_is_no_traceback(loading: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED_WHILE, loading], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "activecam: interrupted\n")
