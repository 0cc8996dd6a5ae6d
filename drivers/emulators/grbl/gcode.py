"""The G-code that the emulator understands: straight lines, dwells, units and distances."""

import re
from dataclasses import dataclass, field
from typing import Final

INCH: Final = 25.4
_WORD = re.compile(r"([A-Z])([+-]?(?:\d+\.?\d*|\.\d+))")
_MOTIONS = {0, 1}
_KNOWN = {0, 1, 4, 20, 21, 53, 54, 90, 91, 94}


class CodeError(Exception):
    """A line that is refused. `number` is that of `error:`."""

    def __init__(self, number: int) -> None:
        super().__init__(f"error:{number}")
        self.number = number


@dataclass(slots=True)
class Line:
    """What a line of G-code says. Lengths are in mm, with `inches` already taken into account."""

    codes: set[int] = field(default_factory=set)
    axes: dict[str, float] = field(default_factory=dict)
    feed: float | None = None
    dwell: float | None = None


def parse(text: str, letters: str, *, inches: bool = False) -> Line:
    """Return the words of a line. Raises CodeError: 1 (no letter), 2 (no number), 20 (unsupported)."""
    line = Line()
    unread = text.upper().replace(" ", "")
    words: list[tuple[str, float]] = []
    while unread:
        if not unread[0].isalpha():
            raise CodeError(1)
        match = _WORD.match(unread)
        if match is None:
            raise CodeError(2)
        words.append((match[1], float(match[2])))
        unread = unread[match.end() :]
    for letter, value in words:
        _take(line, letter, value, letters)
    unit = INCH if 20 in line.codes or (inches and 21 not in line.codes) else 1.0
    line.axes = {letter: value * unit for letter, value in line.axes.items()}
    if line.feed is not None:
        line.feed *= unit
    return line


def _take(line: Line, letter: str, value: float, letters: str) -> None:
    match letter:
        case "G":
            if value not in _KNOWN:
                raise CodeError(20)
            line.codes.add(int(value))
        case "F":
            line.feed = value
        case "P":
            line.dwell = value
        case _ if letter in letters:
            line.axes[letter] = value
        case _:
            raise CodeError(20)
