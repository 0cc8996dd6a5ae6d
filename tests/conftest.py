"""Hypothesis looks for new examples at every run by hand; the gate runs the same ones each time."""

import os

from hypothesis import settings

from benchmarks.timing import THREAD_VARIABLES

# Before numpy loads its libraries, whose threads spin while they wait for each other: where a processor has other work
# than one test, as always here, a solution takes several times as long with them.
os.environ |= dict.fromkeys(THREAD_VARIABLES, "1")

# An example may take any time: how long says how busy the machine is.
settings.register_profile("by hand", deadline=None)
settings.register_profile("gate", deadline=None, derandomize=True)
settings.load_profile("gate" if os.environ.get("CI") else "by hand")
