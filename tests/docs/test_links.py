"""Every link of the pages leads somewhere."""

import re
from pathlib import Path

import pytest

from tests.docs.pages import DOCS, pages

_LINK = re.compile(r"(?<!`)\[[^\]]+\]\(([^)\s]+)\)")


def _anchors(path: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    anchors: set[str] = set()
    for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE):
        anchor = plain = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        count = 0
        while anchor in anchors:
            count += 1
            anchor = f"{plain}-{count}"
        anchors.add(anchor)
    return anchors


@pytest.mark.parametrize("name", [*pages(), "../README.md"])
def test_the_links_of_a_page_lead_somewhere(name: str) -> None:
    here = DOCS / name
    text = re.sub(r"^```.*?^```", "", here.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    for link in _LINK.findall(text):
        if link.startswith(("http:", "https:")):
            continue
        file, _, anchor = link.partition("#")
        target = (here.parent / file).resolve() if file else here
        assert target.exists(), f"{name}: {link}: there is no such file"
        if anchor and target.suffix == ".md":
            assert anchor in _anchors(target), f"{name}: {link}: there is no such heading"


def test_every_page_is_in_the_index() -> None:
    index = (DOCS / "README.md").read_text(encoding="utf-8")
    for name in pages():
        if name != "README.md" and not name.startswith("adr/0"):
            assert f"({name})" in index, f"{name} is not in docs/README.md"


def test_every_decision_is_in_its_index() -> None:
    index = (DOCS / "adr/README.md").read_text(encoding="utf-8")
    for path in (DOCS / "adr").glob("0*.md"):
        assert f"({path.name})" in index, f"{path.name} is not in docs/adr/README.md"
