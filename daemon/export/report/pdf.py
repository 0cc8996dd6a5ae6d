"""A report as a PDF of A4 pages, set by matplotlib, which draws its figures too: they stay lines, and words words."""

from collections.abc import Sequence
from io import BytesIO
from typing import Any, Final, assert_never

import matplotlib as mpl
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.patches import Rectangle
from matplotlib.textpath import text_to_path

from daemon.export.report.document import Block, Drawing, Facts, Heading, Report, Table, Verdict, Words
from daemon.export.report.layout import MM_AN_INCH, SETTINGS, WIDTH, draw

A4: Final = (210.0, 297.0)
MARGIN: Final = (A4[0] - WIDTH) / 2
END: Final = A4[1] - 18.0
"""How far down a page (mm) there may be something."""
MM_A_POINT: Final = MM_AN_INCH / 72
LEADING: Final = 1.45
"""From line to line, of the size of the type."""
TEXT, SMALL, LARGE, TITLE = 8.5, 7.0, 11.0, 15.0
LEAST: Final = 4.5
"""Points of the smallest type that a wide table is set in."""
LONGEST: Final = 40
"""Letters of a word."""
GAP: Final = 3.0
"""Between blocks, and between columns (mm)."""
JUDGED: Final = {"good": "#007a55", "usable": "#b36b00", "poor": "#b00020"}


def pdf(report: Report) -> bytes:
    """Return the report as a PDF file."""
    file = BytesIO()
    with (
        mpl.rc_context(SETTINGS),
        PdfPages(file, metadata={"Title": report.title, "CreationDate": None}) as pages,
    ):
        sheet = _Sheet(pages, report.title)
        sheet.words(report.title, TITLE, weight="bold")
        for block, following in zip(report.blocks, [*report.blocks[1:], None], strict=True):
            _set(sheet, block, following)
        sheet.finish()
    return file.getvalue()


def _set(sheet: "_Sheet", block: Block, following: Block | None) -> None:
    match block:
        case Heading():
            # A heading is not left alone at the foot of a page.
            sheet.need(20.0 + (following.height if isinstance(following, Drawing) else 0.0))
            sheet.skip(GAP)
            sheet.words(block.text, LARGE, weight="bold")
        case Words():
            sheet.words(block.text, TEXT)
        case Verdict():
            sheet.verdict(block)
        case Facts():
            sheet.facts(block)
        case Table():
            sheet.table(block)
        case Drawing():
            sheet.drawing(block)
        case _:
            assert_never(block)


class _Sheet:
    """The page that is being set, and how far down it is."""

    def __init__(self, pages: PdfPages, title: str) -> None:
        self._pages, self._title = pages, title
        self._number = 0
        self._page = self._fresh()
        self._down = MARGIN

    def need(self, height: float) -> None:
        """Go on to the next page where so many mm are not left on this one."""
        if self._down + height > END:
            self.finish()
            self._page = self._fresh()
            self._down = MARGIN

    def skip(self, height: float) -> None:
        """Leave some mm free."""
        self._down += height

    def finish(self) -> None:
        """Write the page."""
        self._pages.savefig(self._page)  # type: ignore[no-untyped-call]

    def words(self, text: str, size: float, **style: Any) -> None:
        """Set a paragraph."""
        for line in _lines(text, size, WIDTH, style.get("weight", "normal")):
            self._line(line, size, MARGIN, **style)
        self.skip(GAP / 2)

    def verdict(self, verdict: Verdict) -> None:
        """Set the verdict, with a bar of its colour beside it."""
        lines = _lines(verdict.sentence, TEXT + 1, WIDTH - 6, "normal")
        height = len(lines) * _height(TEXT + 1)
        self.need(height)
        self._bar(self._down, height, JUDGED.get(verdict.judgement, "#555555"))
        for line in lines:
            self._line(line, TEXT + 1, MARGIN + 6)
        self.skip(GAP)

    def facts(self, facts: Facts) -> None:
        """Set what is what: names, and beside them what they are."""
        beside = max(_width(name, TEXT, "normal") for name, _ in facts.rows) + 2 * GAP
        for name, fact in facts.rows:
            lines = _lines(fact, TEXT, WIDTH - beside, "normal")
            self.need(len(lines) * _height(TEXT))
            self._put(name, TEXT, MARGIN, "left", color="#444444")
            for line in lines:
                self._line(line, TEXT, MARGIN + beside)
        self.skip(GAP)

    def table(self, table: Table) -> None:
        """Set a table, its headings again on every page that it goes on to."""
        size, widths = _columns(table)
        self.need(5 * _height(size))
        if table.title:
            self.words(table.title, size + 0.5, weight="bold")
        self._row(table.headings, table.words, widths, size, weight="bold")
        for row in table.rows:
            if self._down + _height(size) > END:
                self.need(_height(size))
                self._row(table.headings, table.words, widths, size, weight="bold")
            self._row(row, table.words, widths, size)
        self.skip(GAP)

    def drawing(self, drawing: Drawing) -> None:
        """Set a figure over its caption."""
        caption = _lines(drawing.caption, SMALL, WIDTH, "normal")
        self.need(drawing.height + len(caption) * _height(SMALL))
        draw(drawing, self._page, MARGIN, self._down, A4)
        self.skip(drawing.height)
        for line in caption:
            self._line(line, SMALL, MARGIN, color="#444444")
        self.skip(GAP)

    def _fresh(self) -> Figure:
        self._number += 1
        page = Figure(figsize=(A4[0] / MM_AN_INCH, A4[1] / MM_AN_INCH))
        foot: dict[str, Any] = {"fontsize": SMALL, "color": "#444444", "parse_math": False, "va": "baseline"}
        page.text(MARGIN / A4[0], 10 / A4[1], _lines(self._title, SMALL, 0.9 * WIDTH, "normal")[0], **foot)
        page.text(1 - MARGIN / A4[0], 10 / A4[1], str(self._number), ha="right", **foot)
        return page

    def _row(
        self, cells: Sequence[str], words: int, widths: Sequence[float], size: float, **style: Any
    ) -> None:
        left = MARGIN
        self.need(_height(size))
        for number, (cell, width) in enumerate(zip(cells, widths, strict=True)):
            if cell and number < words:
                self._put(cell, size, left, "left", **style)
            elif cell:
                self._put(cell, size, left + width, "right", **style)
            left += width + GAP
        self.skip(_height(size))

    def _line(self, text: str, size: float, left: float, **style: Any) -> None:
        self.need(_height(size))
        self._put(text, size, left, "left", **style)
        self.skip(_height(size))

    def _put(self, text: str, size: float, x: float, side: str, **style: Any) -> None:
        y = 1 - (self._down + size * MM_A_POINT) / A4[1]
        self._page.text(x / A4[0], y, text, fontsize=size, ha=side, va="baseline", parse_math=False, **style)

    def _bar(self, top: float, height: float, colour: str) -> None:
        corner = MARGIN / A4[0], 1 - (top + height) / A4[1]
        self._page.add_artist(Rectangle(corner, 2 / A4[0], height / A4[1], color=colour, linewidth=0))


def _height(size: float) -> float:
    return size * LEADING * MM_A_POINT


def _columns(table: Table) -> tuple[float, list[float]]:
    """Return the size of type (points) in which a table fits, and its columns' widths (mm)."""
    widths = [
        max(_width(heading, SMALL, "bold"), *(_width(row[column], SMALL, "normal") for row in table.rows))
        for column, heading in enumerate(table.headings)
    ]
    shrink = min(1.0, (WIDTH - GAP * (len(widths) - 1)) / sum(widths))
    size = max(SMALL * shrink, LEAST)
    return size, [width * size / SMALL for width in widths]


def _lines(text: str, size: float, width: float, weight: str) -> list[str]:
    """Return the lines of a text that is set so wide (mm); words that go on for ever are broken."""
    lines: list[str] = []
    words = [word[start : start + LONGEST] for word in text.split() for start in range(0, len(word), LONGEST)]
    for word in words:
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and _width(longer, size, weight) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines or [""]


def _width(text: str, size: float, weight: str) -> float:
    font = FontProperties(size=size, weight=weight)
    return float(text_to_path.get_text_width_height_descent(text, font, ismath=False)[0]) * MM_A_POINT
