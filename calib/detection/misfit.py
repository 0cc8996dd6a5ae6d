"""What covers a part of a drawing: told by what is left of the grey values, beside what the good ones leave."""

import numpy as np
from numpy.typing import NDArray

from calib.detection.strips import Floats

GOOD = 0.25  # of the pieces, where a hand or the edge of something else covers the others
MORE = 4.0  # times what good ones leave; lenses and prints that are drawn none too well make it 3 at the most
MOST_CONTRAST = 2.5  # times what most have; more and a fit has made it up


def uncovered(
    scatters: Floats, contrasts: Floats, noise: float, shown: NDArray[np.bool_], little: float
) -> NDArray[np.bool_]:
    """Tell which of the pieces that are `shown` (n,) have nothing in sight but what is drawn.

    `scatters` (n,) are the standard deviations of grey values about the drawing, with `noise` of the camera, and
    `contrasts` (n,) those of the drawing. What leaves no more than `little` of its contrast is always good.
    """
    if not shown.any():
        return shown
    left = np.quantile(scatters[shown] / contrasts[shown], GOOD)
    most = np.hypot(2 * noise, max(little, MORE * float(left)) * contrasts)
    good: NDArray[np.bool_] = shown & (scatters < most)
    good &= contrasts < MOST_CONTRAST * np.median(contrasts[shown])
    return good
