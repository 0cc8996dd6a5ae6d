"""The modified (Craig) Denavit-Hartenberg link with a scale and zero-offset per joint (eq 9 to 11)."""

from math import cos, sin

import numpy as np
from numpy.typing import NDArray


def link_transform(
    kind: str,
    a_prev: float,
    alpha_prev: float,
    d_offset: float,
    theta_offset: float,
    scale: float,
    reading: float,
) -> NDArray[np.float64]:
    """Return previous_from_link (4, 4) at `reading`: Tx(a) Rx(alpha) Tz(d) Rz(theta); m and rad.

    The scaled reading adds to theta on a revolute joint (eq 10), to d on a prismatic one (eq 11).
    """
    theta = theta_offset + (scale * reading if kind == "revolute" else 0.0)
    d = d_offset + (scale * reading if kind == "prismatic" else 0.0)
    ct, st, ca, sa = cos(theta), sin(theta), cos(alpha_prev), sin(alpha_prev)
    return np.array(
        [
            [ct, -st, 0.0, a_prev],
            [st * ca, ct * ca, -sa, -sa * d],
            [st * sa, ct * sa, ca, ca * d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
