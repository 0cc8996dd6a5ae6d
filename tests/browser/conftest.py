"""One Chromium and one daemon for each module; a page of its own for each test."""

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from benchmarks.chromium import CHROMIUM, chromium
from tests.browser.daemons import Daemon

AXE_VERSION = "4.14.1"
CACHE = Path(__file__).parents[2] / ".npm-for-tests"
"""Where npm puts what the tests need of it."""
PATIENCE = 60_000
"""Milliseconds that a busy machine may take to show something."""
expect.set_options(timeout=PATIENCE)


def missing(what: str) -> None:
    """Skip for want of a program, which the gate installs."""
    if os.environ.get("CI"):
        pytest.fail(f"{what} is not installed, and .ci/run should have done it")
    pytest.skip(f"{what} is not installed")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if not Path(CHROMIUM).exists():
        missing("chromium")
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon that asks nobody for a key."""
    daemon = Daemon(tmp_path_factory.mktemp("rig"))
    daemon.start()
    yield daemon
    daemon.stop()


@pytest.fixture(scope="session")
def axe() -> str:
    """The accessibility checker's source."""
    source = CACHE / "node_modules" / "axe-core" / "axe.min.js"
    package = source.with_name("package.json")
    if not package.exists() or f'"version": "{AXE_VERSION}"' not in package.read_text(encoding="utf-8"):
        if shutil.which("npm") is None:
            missing("npm")
        CACHE.mkdir(exist_ok=True)
        install = ["npm", "install", "--prefix", str(CACHE), "--no-package-lock", "--ignore-scripts"]
        subprocess.run([*install, f"axe-core@{AXE_VERSION}"], check=True, capture_output=True)
    return source.read_text(encoding="utf-8")


@pytest.fixture
def open_page(browser: Browser) -> Iterator[Callable[..., Page]]:
    """Open a tab at an address, as another user unless `beside` another one; errors of scripts fail the test."""
    errors: list[str] = []
    contexts = []

    def open_one(address: str, *, beside: Page | None = None, **context: object) -> Page:
        if beside is None:
            contexts.append(browser.new_context(**{"viewport": {"width": 1440, "height": 900}} | context))  # type: ignore[arg-type]
        page = (contexts[-1] if beside is None else beside.context).new_page()
        page.set_default_timeout(PATIENCE)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(address)
        return page

    yield open_one
    for context in contexts:
        context.close()
    assert errors == []
