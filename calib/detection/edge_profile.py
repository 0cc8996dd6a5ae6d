"""What blur makes of edges."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

Singles = NDArray[np.float32]

FIRST_BLUR = 1.0  # px; tried before it is known
SHOWN = 3.0  # standard deviations of the blur to both sides of an edge: all that tells where it is
PAPER = 1.5  # px beyond that, which tell the levels on both sides
NARROWEST = 1.5  # px


def clear_width(blur: float, clear: float, kept_off: float) -> float:
    """Give the width (px) to each side in which an edge is to be measured.

    `clear` px are free; what is beyond is kept off by so many times the blur.
    """
    return max(min(SHOWN * blur + PAPER, clear - kept_off * blur), NARROWEST)


def profile(heights: Singles) -> tuple[Singles, Singles]:
    """Draw an edge from -1 to 1 at heights over the blur's standard deviation; and half the slope there."""
    return np.asarray(erf(heights * sqrt(0.5))), np.exp(heights * heights * -0.5) * (1 / sqrt(2 * pi))


def correlated(
    heights: Sequence[Singles], densities: Sequence[Singles], correlation: Singles
) -> tuple[Singles, tuple[Singles, Singles]]:
    """Give by how much the blurred corner of two edges is above the product of the two blurred edges.

    The blurred corner is the bivariate normal distribution of the edges' heights, correlated by the cosine of
    the angle between their normals: the first two terms of the tetrachoric series; and its derivatives by the
    heights.
    """
    one, other = heights
    both = correlation * densities[0] * densities[1]
    half = correlation / np.float32(2)
    series = 1 + half * one * other
    by_one: Singles = both * (half * other - one * series)
    by_other: Singles = both * (half * one - other * series)
    above: Singles = both * series
    return above, (by_one, by_other)
