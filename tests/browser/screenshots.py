"""Pictures of the page in each of its states: `python -m tests.browser.screenshots FOLDER`, or `make screenshots`.

Each is taken at the width of a desk and of a tablet, in light and in dark, for whoever changes the page to look at.
"""

import itertools
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, Literal

import httpx
from playwright.sync_api import Browser, Page, expect

from benchmarks.chromium import chromium
from tests.browser.daemons import Daemon

WIDTHS: Final = (1440, 800)
HEIGHT: Final = 960
Scheme = Literal["light", "dark"]
SCHEMES: Final[tuple[Scheme, ...]] = ("light", "dark")
PATIENCE: Final = 60_000
"""Milliseconds that a state may take to come about; coverage looks at all pictures of a run."""

expect.set_options(timeout=PATIENCE)
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
    expect(page.get_by_role("meter").first).to_be_visible()


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


def takeaway(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    page.goto(f"{daemon.address}#/takeaway")
    expect(page.get_by_role("link", name="rig.urdf")).to_be_visible()


def gone(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    ready(page, daemon, api)
    daemon.kill()
    expect(page.get_by_role("alert")).to_contain_text("The daemon does not answer")


def asked_for_a_key(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    page.goto(daemon.address)
    expect(page.get_by_label("Key")).to_be_focused()


def seen_by_a_viewer(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    asked_for_a_key(page, daemon, api)
    page.get_by_label("Key").fill(daemon.key("viewer"))
    page.wait_for_timeout(1000)  # in which the daemon learns of the key
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_text("it sees everything and changes nothing")).to_be_visible()
    expect(page.locator(".rate")).to_contain_text("pictures/s")
    daemon.forget_key("viewer")


STATES: Final[dict[str, State]] = {
    "rig": ready,
    "rig-homed": homed,
    "rig-coverage": covered,
    "rig-held": held_by_another,
    "rig-stopped": stopped,
    "history": history,
    "takeaway": takeaway,
    "gone": gone,
}
GUARDED: Final[dict[str, State]] = {"key": asked_for_a_key, "viewer": seen_by_a_viewer}
"""Where keys are asked for."""


def main(folder: Path) -> None:
    """Take all of them into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as data, chromium() as browser:
        daemon = Daemon(Path(data), "paper-table")
        daemon.start()
        with httpx.Client(base_url=f"{daemon.address}api/v1", timeout=60) as api:
            _calibrate(api)
            for name, state in STATES.items():
                _take(browser, daemon, api, state, folder / name)
        daemon.stop()
    with TemporaryDirectory() as data, chromium() as browser:
        daemon = Daemon(Path(data), "paper-table", keys=True)
        admin = {"Authorization": f"Bearer {daemon.key('admin')}"}
        daemon.start()
        with httpx.Client(base_url=f"{daemon.address}api/v1", timeout=60, headers=admin) as api:
            for name, state in GUARDED.items():
                _take(browser, daemon, api, state, folder / name)
        daemon.stop()


def _calibrate(api: httpx.Client) -> None:
    run = api.post("/runs", json={"owner": "anna", "note": "after the move to room 2"}).json()["id"]
    with api.stream("GET", f"/runs/{run}/events", timeout=600) as events:
        events.read()


def _take(browser: Browser, daemon: Daemon, api: httpx.Client, state: State, file: Path) -> None:
    """Take pictures of a state, from its beginning each time."""
    for width, scheme in itertools.product(WIDTHS, SCHEMES):
        if not daemon.running:
            daemon.start()
        lease = api.post("/lease", json={"owner": "nobody yet", "take_over": True}).json()
        api.delete("/lease", headers={"X-Lease": lease["token"]})
        api.post("/stop/acknowledge")
        context = browser.new_context(viewport={"width": width, "height": HEIGHT}, color_scheme=scheme)
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        state(page, daemon, api)
        page.screenshot(path=f"{file}-{width}-{scheme}.png")
        context.close()
        sys.stdout.write(f"{file}-{width}-{scheme}.png\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
