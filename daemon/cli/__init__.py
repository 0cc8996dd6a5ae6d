"""The command line: one file a command, and `main`, which turns every error into one sentence."""

import os
import sys

# Before numpy loads its libraries, whose threads spin while they wait for each other: they take the processors from the
# loop, from the live picture and from each other.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

try:
    from daemon.cli.main import main
except KeyboardInterrupt:  # which takes a moment, in which somebody may change their mind
    sys.stderr.write("activecam: interrupted\n")
    sys.exit(130)

__all__ = ["main"]
