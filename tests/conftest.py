"""Hypothesis looks for new examples at every run by hand; the gate runs the same ones each time."""

import os

from hypothesis import settings

settings.register_profile("gate", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("gate")
