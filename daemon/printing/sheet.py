"""Where things go on a sheet: the target in its white rim, a ruler down the left side, one below, and words.

The words are white in a black bar, and the rulers have no numbers: black letters are blobs, in which the finder
of a grid of disks loses itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import wrap

import numpy as np
from numpy.typing import NDArray

from calib.ink import Ink, target_ink, white_rim
from calib.targets import Target
from daemon.errors import PrintError
from daemon.printing.paper import NAMED, Paper
from daemon.profile.targets import target_entries
from drivers.quantities import LENGTH, format_quantity

MM = 1e-3
RULER = 100
"""Millimetres on a ruler, from the outer edge of its first tick to that of its last."""
TICK = 0.2 * MM
TICK_LENGTHS = {10: 4.5 * MM, 5: 3.0 * MM, 1: 2.0 * MM}
LINE = 0.5 * MM
TEXT_SIZE = 2.5 * MM
LETTER = 0.6 * TEXT_SIZE
"""How wide a letter is at most, on the average of a sentence and of the writers' fonts."""
LINE_HEIGHT = 3.2 * MM
BAR_EDGE = 1 * MM
"""Black around the words."""
RULER_ROOM = 7 * MM
"""What a ruler takes beside it, with some white."""
ROUNDING = 1e-9

INSTRUCTION = (
    "Print at 100 % (no fitting to the page): both rulers must measure 100 mm from end to end. Measure the target "
    "across many pitches, and write its real lengths into the profile."
)


@dataclass(frozen=True)
class Text:
    """A line of white words, its first letter's lower left corner at x, y (m); its size is TEXT_SIZE."""

    x: float
    y: float
    words: str


@dataclass(frozen=True, eq=False)
class Sheet:
    """A page, in metres from its top left corner, x to the right and y down."""

    title: str
    width: float
    height: float
    ink: Ink
    """The target's, and after it the rulers' and the bar's behind the words."""
    texts: tuple[Text, ...]
    origin: tuple[float, float]
    """Where the target's point 0, the world's origin, is."""


def lay_out(target: Target, paper: Paper, margin: float = 10 * MM) -> Sheet:
    """Lay the target out on paper, true to scale, the paper turned if need be.

    `margin` (m) is what the printer cannot print on. Raises PrintError where the target does not fit, with
    what would.
    """
    sheet = _fitting(target, paper, margin)
    if sheet is None:
        raise PrintError(
            f"the {_words(target.kind)} does not fit on {paper.name} with its white rim, the rulers and margins of "
            f"{format_quantity(margin, LENGTH, 'mm')}: {_what_fits(target, paper, margin)}"
        )
    return sheet


def _fitting(target: Target, paper: Paper, margin: float) -> Sheet | None:
    """Return the sheet with the paper upright, else lying, None where the target fits in neither way."""
    short, long = sorted((paper.width, paper.height))
    for width, height in ((short, long), (long, short)):
        sheet = _placed(target, width, height, margin)
        if sheet is not None:
            return sheet
    return None


def _placed(target: Target, width: float, height: float, margin: float) -> Sheet | None:
    """Place the target in the middle of what the margins, the rulers and the words leave of a page."""
    printable = width - 2 * margin
    long_enough = RULER * MM + RULER_ROOM - ROUNDING
    if printable < long_enough:
        return None
    title = f"activecam target: {_words(target.kind)}, {_described(target)}"
    letters = int((printable - 2 * BAR_EDGE) / LETTER)
    lines = [*wrap(title, letters), *wrap(INSTRUCTION, letters)]
    bar_height = len(lines) * LINE_HEIGHT + BAR_EDGE
    bar_top = height - margin - bar_height
    bottom = bar_top - RULER_ROOM
    if bottom - margin < long_enough:
        return None

    ink, rim = target_ink(target), white_rim(target)
    left, top, right, lower = ink.extent()
    rim_or_margin = max(rim, margin)
    spare_x = width - rim_or_margin - (margin + RULER_ROOM + rim) - (right - left)
    spare_y = bottom - rim - rim_or_margin - (lower - top)
    if min(spare_x, spare_y) < -ROUNDING:
        return None
    origin = (margin + RULER_ROOM + rim + spare_x / 2 - left, rim_or_margin + spare_y / 2 - top)

    lying = _ruler() + np.array([margin, bottom, 0, 0])
    upright = _ruler()[:, [1, 0, 3, 2]] + np.array([margin, margin, 0, 0])
    bar = [[margin, bar_top, printable, bar_height]]
    texts = (
        Text(margin + BAR_EDGE, bar_top + (row + 1) * LINE_HEIGHT, line) for row, line in enumerate(lines)
    )
    drawn = ink.moved(*origin).with_rectangles(np.concatenate([lying, upright, bar]))
    return Sheet(title, width, height, drawn, tuple(texts), origin)


def _described(target: Target) -> str:
    entries = target_entries(target).items()
    return ", ".join(f"{_words(name)} {value}" for name, value in entries if name != "kind")


def _words(name: str) -> str:
    return name.replace("_", " ")


def _ruler() -> NDArray[np.float64]:
    """Draw a lying ruler from x = 0, y = 0: its line, and ticks below that (n, 4)."""
    length = RULER * MM
    ticks = [[0.0, 0.0, length, LINE]]
    for mark in range(RULER + 1):
        reach = next(reach for step, reach in TICK_LENGTHS.items() if mark % step == 0)
        # The first and the last end where the ruler does, for a calliper's jaws.
        left = min(max(mark * MM - TICK / 2, 0.0), length - TICK)
        ticks.append([left, LINE, TICK, reach])
    return np.array(ticks)


def _what_fits(target: Target, paper: Paper, margin: float) -> str:
    """Say on which paper the target fits, or how much smaller it fits on this one."""
    larger = next((other.name for other in NAMED if _fitting(target, other, margin)), None)
    choices = [f"take {larger}"] if larger else []
    for percent in range(99, 0, -1):
        smaller = _scaled(target, percent / 100)
        if _fitting(smaller, paper, margin):
            choices.append(f"make it {percent} % as large ({_described(smaller)})")
            break
    return ", or ".join(choices) or "take larger paper, a smaller target or narrower margins"


def _scaled(target: Target, factor: float) -> Target:
    """Return a target of other size, lengths to a hundredth of a millimetre."""
    lengths = {name: value for name, value in target if isinstance(value, float)}
    return target.model_copy(update={name: round(value * factor, 5) for name, value in lengths.items()})
