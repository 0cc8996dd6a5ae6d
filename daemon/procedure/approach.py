"""From which side each axis came to where it stands: what a solver needs to see backlash."""

from collections.abc import Mapping, Sequence
from typing import Literal

Side = Literal[-1, 0, 1]


class Approach:
    """The direction of each axis's latest motion: +1 with growing reading, -1 with falling, 0 not known."""

    def __init__(self, axes: Sequence[str]) -> None:
        self._sides: dict[str, Side] = dict.fromkeys(axes, 0)

    @property
    def sides(self) -> list[Side]:
        """The sides in chain order."""
        return list(self._sides.values())

    def moved(self, before: Mapping[str, float], targets: Mapping[str, float]) -> None:
        """Take note of a move; an axis that was already at its target keeps its side."""
        for axis, target in targets.items():
            if target != before[axis]:
                self._sides[axis] = 1 if target > before[axis] else -1
