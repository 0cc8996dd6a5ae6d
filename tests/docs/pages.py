"""The pages of the documentation, as the tests read them: their fenced blocks and tables."""

import re
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"

_FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    page: str
    line: int
    language: str
    text: str

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def pages() -> list[str]:
    """Every page below docs/, by its path there."""
    return sorted(str(path.relative_to(DOCS)) for path in DOCS.rglob("*.md"))


def page(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def blocks(name: str, language: str) -> list[Block]:
    text = page(name)
    found = [(match[1], match[2], text.count("\n", 0, match.start()) + 1) for match in _FENCE.finditer(text)]
    return [Block(name, line, kind, body) for kind, body, line in found if kind == language]


def table_below(text: str, lead: str) -> list[list[str]]:
    """Return the cells of the first table after the line `lead`, without its head."""
    _, found, rest = f"\n{text}".partition(f"\n{lead}\n")
    assert found, f"there is no line {lead!r}"
    rows: list[str] = []
    for line in rest.splitlines():
        if line.startswith("|"):
            rows.append(line)
        elif rows:
            break
        assert not line.startswith("#"), f"no table follows {lead!r}"
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in rows[2:]]


def unquoted(cell: str) -> str:
    return cell.strip("`")
