"""Tables of figures, as all benchmarks print them."""

from typing import Final

from rich.console import Console
from rich.table import Table

from benchmarks.timing import Pairs, Spread

FILE_WIDTH: Final = 130
"""Columns of a table that goes into a file or a pipe."""

console = Console(highlight=False, width=None if Console().is_terminal else FILE_WIDTH)


def table(title: str, *headings: str) -> Table:
    """Return a table whose first column is text and whose others are figures."""
    made = Table(title=title, title_justify="left")
    for index, heading in enumerate(headings):
        made.add_column(heading, justify="left" if index == 0 else "right")
    return made


def timing_table(title: str) -> Table:
    """Return a table for `add_pairs`."""
    return table(
        title, "A over B", "A: median", "min..max", "B: median", "min..max", "A / B: median", "min..max"
    )


def add_pairs(rows: Table, label: str, pairs: Pairs, factor: float = 1.0, digits: int = 2) -> None:
    """Add a row with both sides of `pairs`, times `factor`, and their pairwise ratio."""
    cells: list[str] = []
    for side in (pairs.a, pairs.b):
        cells += spread_cells(Spread.of([factor * value for value in side]), digits)
    rows.add_row(label, *cells, *spread_cells(pairs.ratio, 3))


def spread_cells(spread: Spread, digits: int) -> list[str]:
    """Return the cells `median` and `min..max`."""
    return [f"{spread.median:.{digits}f}", f"{spread.low:.{digits}f}..{spread.high:.{digits}f}"]


def say(sentence: str) -> None:
    """Print a sentence under or over a table."""
    console.print(sentence, markup=False, soft_wrap=True)
