"""Sheets of paper by their names, or by their size."""

import re
from dataclasses import dataclass

from drivers.quantities import LENGTH, NUMBER, parse_quantity

_SIZE = re.compile(rf"\s*({NUMBER})\s*[xX×]\s*({NUMBER})\s*([a-z]+)\s*", re.ASCII)


@dataclass(frozen=True)
class Paper:
    """A sheet, in metres. Which side is called its width does not matter: it may be turned."""

    name: str
    width: float
    height: float


NAMED = (
    Paper("A4", 0.210, 0.297),
    Paper("Letter", 0.2159, 0.2794),
    Paper("A3", 0.297, 0.420),
    Paper("A2", 0.420, 0.594),
    Paper("A1", 0.594, 0.841),
    Paper("A0", 0.841, 1.189),
)


def parse_paper(text: str) -> Paper:
    """Return the sheet of a name, such as `A4`, or of a size, such as `300x400 mm`; ValueError says what to write."""
    for paper in NAMED:
        if paper.name.lower() == text.strip().lower():
            return paper
    size = _SIZE.fullmatch(text)
    if size is None:
        names = ", ".join(paper.name for paper in NAMED)
        raise ValueError(f"'{text}' is no paper: write one of {names}, or a size such as '300x400 mm'")
    width, height = (parse_quantity(f"{number} {size[3]}", LENGTH) for number in (size[1], size[2]))
    if min(width, height) <= 0:
        raise ValueError(f"a sheet of '{text}' has no area: write a size such as '300x400 mm'")
    return Paper(text.strip(), width, height)
