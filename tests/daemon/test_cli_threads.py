"""Threads of numpy's libraries: none beside the command's own, unless somebody asks for them."""

import os
import subprocess
import sys

import pytest

from benchmarks.timing import THREAD_VARIABLES

COUNTED = "import os, daemon.cli, scipy.linalg; print(len(os.listdir('/proc/self/task')))"


@pytest.mark.skipif(os.cpu_count() == 1, reason="such a machine has one thread in any case")
@pytest.mark.parametrize("asked", [None, "2"])
def test_there_is_one_unless_more_are_asked_for(asked: str | None) -> None:
    environment = {name: value for name, value in os.environ.items() if name not in THREAD_VARIABLES}
    if asked is not None:
        environment["OPENBLAS_NUM_THREADS"] = asked
    counted = subprocess.run(
        [sys.executable, "-c", COUNTED], env=environment, capture_output=True, text=True, check=True
    )
    assert (int(counted.stdout) > 1) == (asked is not None)
