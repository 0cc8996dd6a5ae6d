"""The technician's page as files: complete, small, its own, and asked for again only when it has changed."""

import re
from pathlib import Path

import httpx
import pytest
from hatchling.builders.wheel import WheelBuilder

from daemon.api import create_app
from daemon.service import Service

PAGE = Path(__file__).parents[2] / "daemon" / "page"
FILES = sorted(PAGE.iterdir())
LARGEST = 300_000
"""Bytes that the page may have in all."""


@pytest.fixture
async def root(service: Service) -> httpx.AsyncClient:
    return httpx.AsyncClient(transport=httpx.ASGITransport(create_app(service)), base_url="http://localhost")


def references(text: str) -> set[str]:
    """Return the files that a file refers to: as the index does, or as modules import each other."""
    names = re.findall(r'(?:href|src)="page/([^"]+)"', text)
    return {*names, *re.findall(r'(?:from|import\()\s*"\./([^"]+)"', text)}


async def test_every_file_is_served_as_what_it_is(root: httpx.AsyncClient) -> None:
    index = await root.get("/")
    assert index.headers["content-type"] == "text/html; charset=utf-8"
    kinds = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
    for file in FILES:
        if file.name != "index.html":
            answer = await root.get(f"/page/{file.name}")
            assert answer.content == file.read_bytes()
            assert answer.headers["content-type"].split(";")[0] == kinds[file.suffix]
    for name in ("index.html", "none.js", "__init__.py", "..%2Fservice.py"):
        assert (await root.get(f"/page/{name}")).status_code == 404


async def test_nothing_but_its_own_files_may_run(root: httpx.AsyncClient) -> None:
    for path in ("/", "/page/main.js"):
        policy = (await root.get(path)).headers["content-security-policy"]
        assert "default-src 'self'" in policy
        assert "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy


async def test_what_has_not_changed_is_not_sent_again(root: httpx.AsyncClient) -> None:
    for path in ("/", "/page/page.css"):
        first = await root.get(path)
        again = await root.get(path, headers={"If-None-Match": first.headers["etag"]})
        assert (again.status_code, again.content) == (304, b"")
        other = await root.get(path, headers={"If-None-Match": '"another"'})
        assert (other.status_code, other.content) == (200, first.content)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_a_file_refers_to_what_there_is_and_to_nothing_elsewhere(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    assert references(text) <= {each.name for each in FILES}
    assert not re.findall(r"https?://(?!www\.w3\.org/2000/svg)", text)
    assert not re.findall(r'["\'(]/(?:api|page)\b', text)  # which no proxy under a path of its own would find
    assert "innerHTML" not in text


def test_every_file_is_used_and_all_of_them_are_small() -> None:
    used = set().union(*(references(file.read_text(encoding="utf-8")) for file in FILES))
    assert used == {file.name for file in FILES} - {"index.html"}
    assert sum(file.stat().st_size for file in FILES) < LARGEST


def test_what_the_stop_waits_for_is_asked_for_at_once() -> None:
    needed, found = {"main.js"}, {"main.js"}
    while (
        found
    ):  # what is imported by what is imported, but for sections, which are loaded when they are shown
        texts = [(PAGE / name).read_text(encoding="utf-8") for name in found]
        found = {name for text in texts for name in re.findall(r'from "\./([^"]+)"', text)} - needed
        needed |= found
    index = (PAGE / "index.html").read_text(encoding="utf-8")
    assert set(re.findall(r'rel="modulepreload" href="page/([^"]+)"', index)) == needed - {"main.js"}


def test_the_wheel_has_the_page() -> None:
    root = PAGE.parents[1]
    packed = {file.distribution_path for file in WheelBuilder(str(root)).recurse_included_files()}
    assert {f"daemon/page/{file.name}" for file in FILES} <= packed
