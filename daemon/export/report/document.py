"""What a report consists of, whoever lays it out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes


@dataclass(frozen=True)
class Heading:
    """Where a section begins."""

    text: str


@dataclass(frozen=True)
class Words:
    """A paragraph."""

    text: str


@dataclass(frozen=True)
class Verdict:
    """The judgement in one word, good, usable, poor or unknown, and the sentence that it rests on."""

    judgement: str
    sentence: str


@dataclass(frozen=True)
class Table:
    """Rows under headings, of which the first `words` columns are words, and the others figures."""

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    words: int = 1


@dataclass(frozen=True)
class Facts:
    """What is what."""

    rows: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Panel:
    """One of the drawings of a figure, and how wide it is beside the others."""

    draw: Callable[[Axes], None]
    share: float = 1.0
    right: float = 4.0
    """What is left free beside it (mm)."""


@dataclass(frozen=True)
class Drawing:
    """A figure: panels side by side, `height` mm high, and what there is to see in them."""

    panels: Sequence[Panel]
    caption: str
    height: float = 65.0


Block = Heading | Words | Verdict | Facts | Table | Drawing


@dataclass(frozen=True)
class Report:
    """A title, and what follows it from top to bottom."""

    title: str
    blocks: Sequence[Block]
