"""Two equal prints in one picture: nobody knows which is the target's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.errors import DetectionError


def two_prints(noun: str, target: str, twice: NDArray[np.int64]) -> DetectionError:
    """Say which of the target's numbered tags or markers are seen more than once, and what to do."""
    others = f" and {len(twice) - 1} others" if len(twice) > 1 else ""
    return DetectionError(
        f"{noun} {twice[0]}{others} of {target} can be seen twice, so that nobody knows which is the target's: "
        "leave only one print of it in view, and no mirror"
    )
