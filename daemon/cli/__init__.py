"""The command line: one file a command, and `main`, which turns every error into one sentence."""

import os

# Before numpy loads its libraries, whose threads spin while they wait for each other: they take the processors from the
# loop, from the live picture and from each other.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

from daemon.cli.main import main  # noqa: E402

__all__ = ["main"]
