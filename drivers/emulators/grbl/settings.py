"""The settings that Grbl keeps in its EEPROM, by number."""

from collections.abc import Mapping, Sequence

LETTERS = "XYZABC"

DEFAULTS: Mapping[int, float] = {
    0: 10,
    1: 255,
    2: 0,
    3: 0,
    4: 0,
    5: 0,
    6: 0,
    10: 1,
    11: 0.010,
    12: 0.002,
    13: 0,
    20: 1,
    21: 0,
    22: 1,
    23: 0,
    24: 60,
    25: 600,
    26: 250,
    27: 1,
    30: 1000,
    31: 0,
    32: 0,
}
PER_AXIS: Mapping[int, float] = {100: 250, 110: 600, 120: 50, 130: 200}
"""Steps per mm, mm/min, mm/s2, and the travel (mm) of axes that nothing else is said of."""
_INTEGER = {0, 1, 2, 3, 4, 5, 6, 10, 13, 20, 21, 22, 23, 26, 30, 31, 32}


class Settings(dict[int, float]):
    """Numbers as `$$` lists them."""

    def __init__(self, letters: Sequence[str], changes: Mapping[int, float]) -> None:
        per_axis = {base + i: value for base, value in PER_AXIS.items() for i in range(len(letters))}
        super().__init__({**DEFAULTS, **per_axis, **changes})

    def lines(self) -> list[str]:
        """Return the answer to `$$`, without its ok."""
        return [f"${number}={self._text(number)}" for number in sorted(self)]

    def _text(self, number: int) -> str:
        return f"{self[number]:.0f}" if number in _INTEGER else f"{self[number]:.3f}"
