"""What a reading's unit says: its nominal measure in SI, where it has one."""

from math import pi

NOMINAL = {
    "prismatic": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
    "revolute": {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180, "turn": 2 * pi, "rev": 2 * pi},
}


def nominal_scale(kind: str, reading_unit: str) -> float | None:
    """Return the radians or metres that one `reading_unit` nominally is; None for counts and the like."""
    return NOMINAL[kind].get(reading_unit)
