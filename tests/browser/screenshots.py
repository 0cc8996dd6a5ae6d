"""Pictures of the page in each of its states: `python -m tests.browser.screenshots FOLDER`, or `make screenshots`.

Each is taken at the width of a desk and of a tablet, in light and in dark, for whoever changes the page to look at.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import httpx
from playwright.sync_api import Browser, Page, expect

from benchmarks.chromium import chromium
from tests.browser.daemons import Daemon

WIDTHS: Final = (1440, 800)
HEIGHT: Final = 960

State = Callable[[Page, Daemon, httpx.Client], None]


def ready(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    page.goto(daemon.address)
    expect(page.locator(".words")).not_to_be_empty()
    expect(page.locator(".rate")).to_contain_text("pictures/s")


def homed(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    ready(page, daemon, api)
    for axis in ("slide", "pan"):
        card = page.get_by_role("article", name=f"Axis {axis}")
        if card.locator(".condition").text_content() != "homed":
            card.get_by_role("button", name="Home").click()
            expect(card.locator(".condition")).to_have_text("homed")
    for axis, reading in (("slide", "620"), ("pan", "-4.5")):
        page.get_by_label(f"Go to, {axis}").fill(reading)
        page.get_by_label(f"Go to, {axis}").press("Enter")
    expect(page.locator("#connection")).to_have_text("Connected")
    page.get_by_label("Go to, pan").focus()


def covered(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    ready(page, daemon, api)
    page.get_by_label("Coverage").check()
    expect(page.get_by_role("meter").first).to_be_visible(timeout=120_000)


def held_by_another(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    ready(page, daemon, api)
    api.post("/lease", json={"owner": "anna", "note": "aligning the target"}).raise_for_status()
    expect(page.get_by_role("button", name="Take over")).to_be_visible()


def stopped(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    ready(page, daemon, api)
    page.keyboard.press("Escape")
    expect(page.get_by_role("button", name="Acknowledge")).to_be_visible()


def history(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    page.goto(f"{daemon.address}#/history")
    expect(page.get_by_role("table")).to_be_visible()


def gone(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    ready(page, daemon, api)
    daemon.kill()
    expect(page.get_by_text("The daemon does not answer")).to_be_visible()


STATES: Final[dict[str, State]] = {
    "rig": ready,
    "rig-homed": homed,
    "rig-coverage": covered,
    "rig-held": held_by_another,
    "rig-stopped": stopped,
    "history": history,
    "gone": gone,
}


def main(folder: Path) -> None:
    """Take all of them into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as data, chromium() as browser:
        daemon = Daemon(Path(data), "paper-table")
        daemon.start()
        with httpx.Client(base_url=f"{daemon.address}api/v1", timeout=60) as api:
            _calibrate(api)
            for name, state in STATES.items():
                for width in WIDTHS:
                    for scheme in ("light", "dark"):
                        _take(
                            browser,
                            daemon,
                            api,
                            state,
                            folder / f"{name}-{width}-{scheme}.png",
                            width,
                            scheme,
                        )
        daemon.stop()


def _calibrate(api: httpx.Client) -> None:
    run = api.post("/runs", json={"owner": "anna", "note": "after the move to room 2"}).json()["id"]
    with api.stream("GET", f"/runs/{run}/events", timeout=600) as events:
        events.read()


def _take(
    browser: Browser, daemon: Daemon, api: httpx.Client, state: State, file: Path, width: int, scheme: str
) -> None:
    if not daemon.running:
        daemon.start()
    api.post("/stop/acknowledge")
    context = browser.new_context(
        viewport={"width": width, "height": HEIGHT}, color_scheme="dark" if scheme == "dark" else "light"
    )
    page = context.new_page()
    try:
        state(page, daemon, api)
        page.screenshot(path=file)
    finally:
        context.close()
        if daemon.running:
            lease = api.post("/lease", json={"owner": "the next picture", "take_over": True}).json()
            api.delete("/lease", headers={"X-Lease": lease["token"]})
    sys.stdout.write(f"{file}\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
