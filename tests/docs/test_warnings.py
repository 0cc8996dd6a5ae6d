"""The warnings and errors that docs/how-to/calibrate-a-rig.md explains are those that the code gives."""

import re
from pathlib import Path

import pytest

from tests.docs.pages import page, table_below

PAGE = "how-to/calibrate-a-rig.md"
ROOT = Path(__file__).parents[2]


def _sentences() -> str:
    """The sources, with the strings that are written over several lines as one."""
    sources = [path for room in ("calib", "daemon", "drivers") for path in (ROOT / room).rglob("*.py")]
    text = "\n".join(path.read_text(encoding="utf-8") for path in sources)
    return re.sub(r'"\s*\n\s*f?"', "", text)


def _explained() -> list[str]:
    text = page(PAGE)
    first = table_below(text, "## Warnings")
    second = table_below(text, "And what ends a run or a `solve`:")
    return [row[0] for row in (*first, *second)]


SOURCES = _sentences()


@pytest.mark.parametrize("cell", _explained())
def test_what_is_explained_is_what_the_code_says(cell: str) -> None:
    fragments = [part for quoted in re.findall(r"`([^`]+)`", cell) for part in quoted.split("…")]
    for fragment in fragments:
        assert fragment.strip(" %") in SOURCES, f"{PAGE}: nothing says '{fragment}'"
