"""What was seen of a target in one picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Detection:
    """The target points seen in one picture, by growing id.

    `ids` (n,) are the target's point ids; `pixels` (n, 2) are x, y, pixel (0, 0) being the centre of the
    top-left pixel; `covariances` (n, 2, 2) are in px². A covariance is the noise, what the fit of a disk or of a
    corner leaves of its own pixels or what the picture has in its finest detail, carried through the measurement
    of the point (so that faint, blurred, small and noisy points weigh less), plus a variance for what is not
    noise: (0.0005 px)² each way for disks, (0.001 px)² for corners of chessboards and (0.002 px)² for those of tags.

    `disk` is "centroid" where a pixel is the centroid of a disk's picture, which for a tilted disk is not the
    picture of the disk's centre; None where it is the picture of the point itself.
    """

    ids: NDArray[np.int64]
    pixels: NDArray[np.float64]
    covariances: NDArray[np.float64]
    disk: Literal["centroid"] | None
