"""Figures as people read them, with as many digits as mean anything."""

from collections.abc import Iterable
from math import floor, isfinite, log10


def figure(value: float | None, factor: float = 1.0, digits: int = 3) -> str:
    """Return a number times `factor` with so many digits that mean something; nothing for None."""
    if value is None:
        return ""
    scaled = factor * value
    if scaled == 0 or not isfinite(scaled):
        return f"{scaled:.0f}"
    decimals = digits - 1 - floor(log10(abs(scaled)))
    return f"{scaled:.{decimals}f}" if 0 <= decimals <= 6 else f"{scaled:.{digits}g}"


def known(value: float, std: float | None, factor: float = 1.0) -> tuple[str, str]:
    """Return a number and its standard deviation, both to two digits of the latter; nine where there is none."""
    if std is None or not std > 0 or not isfinite(std):
        return f"{round(factor * value, 12):.9g}", ""
    decimals = min(max(1 - floor(log10(factor * std)), 0), 12)
    return f"{factor * value:.{decimals}f}", f"{factor * std:.{decimals}f}"


def several(values: Iterable[float], form: str, factor: float = 1.0) -> str:
    """Return numbers one after another, each in this form."""
    return "  ".join(format(factor * value, form) for value in values)
