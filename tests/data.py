"""Where real measurements lie, which are not part of the project: tests that use them skip without them."""

import os
from pathlib import Path

import pytest

ROOT = Path(os.environ.get("ACTIVECAM_DATA", Path(__file__).parents[2] / "shared" / "data"))


def real(name: str) -> Path:
    """Return the folder of the real session `name`, or skip the test."""
    if not (ROOT / name).is_dir():
        pytest.skip(f"the real measurements '{name}' are not in {ROOT}: set ACTIVECAM_DATA to their folder")
    return ROOT / name
