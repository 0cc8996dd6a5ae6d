"""Hypothesis looks for new examples at every run by hand; the gate runs the same ones each time."""

import os

from hypothesis import settings

from benchmarks.timing import THREAD_VARIABLES

# Before numpy loads its libraries, whose threads spin while they wait for each other: where a processor has other work
# than one test, as always here, a solution takes several times as long with them.
os.environ |= dict.fromkeys(THREAD_VARIABLES, "1")

settings.register_profile("gate", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("gate")
