"""What changes smoothly over a picture: a lens' bend, the light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

POINTS_A_TERM = 1.5  # fewer would be followed in their own errors
WEAKEST = 1e-3  # of the strongest combination of terms; what the places do not tell stays zero


@dataclass(frozen=True, eq=False)
class Smooth:
    """A polynomial in the pixels, less `middle` (2,) and divided by `span`, of `coefficients` (terms, c)."""

    middle: Floats
    span: float
    coefficients: Floats

    def at(self, pixels: Floats) -> Floats:
        """Give the values (..., c) at pixels (..., 2)."""
        terms = _terms((pixels - self.middle) / self.span, len(self.coefficients))
        return np.asarray(terms @ self.coefficients)


def smooth(pixels: Floats, values: Floats, degree: int) -> Smooth:
    """Fit values (n, c) at pixels (n, 2), up to so high a degree, or less where they are few."""
    middle = pixels.mean(axis=0)
    span = max(float(np.abs(pixels - middle).max()), 1.0)
    degrees = (d for d in range(degree, -1, -1) if len(pixels) >= POINTS_A_TERM * _count(d))
    terms = _terms((pixels - middle) / span, _count(next(degrees, -1)))
    coefficients = np.asarray(np.linalg.lstsq(terms, values, rcond=WEAKEST)[0], dtype=np.float64)
    return Smooth(middle, span, coefficients)


def _count(degree: int) -> int:
    """Count the terms of a polynomial in two variables."""
    return (degree + 1) * (degree + 2) // 2


def _terms(at: Floats, count: int) -> Floats:
    """Give so many powers x^i y^j (..., count) of places (..., 2): all up to a degree."""
    terms = np.ones((*at.shape[:-1], count))
    first, degree = 0, 0
    while first + degree + 1 < count:
        highest, first = terms[..., first : first + degree + 1], first + degree + 1
        degree += 1
        np.multiply(at[..., :1], highest, out=terms[..., first : first + degree])
        np.multiply(at[..., 1], highest[..., -1], out=terms[..., first + degree])
    return terms
