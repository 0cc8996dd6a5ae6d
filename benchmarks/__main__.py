"""`python -m benchmarks`: one thread for the mathematics of ours and of the peers, then the command."""

import os
import sys

from benchmarks.timing import THREAD_VARIABLES

if __name__ == "__main__":
    # The libraries read these once, when numpy loads them.
    for variable in THREAD_VARIABLES:
        os.environ.setdefault(variable, "1")
    from benchmarks.command import main

    sys.exit(main(sys.argv[1:]))
