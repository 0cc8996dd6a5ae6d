"""Pictures of the page in each of its states: `python -m tests.browser.screenshots FOLDER`, or `make screenshots`.

With `STATE ...` after the folder only those are taken.

Each is taken at the width of a desk and of a tablet, in light and in dark, for whoever changes the page to look at.
"""

import itertools
import re
import sys
from collections.abc import Callable, Collection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, Literal

import httpx
from PIL import Image
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
        expect(page.get_by_role("article", name=f"Axis {axis}").locator(".position")).to_contain_text(
            reading.replace("-", "−")
        )
    _let_the_picture_follow(page)
    # At whatever size it was begun with: the click of a mouse would scroll to it.
    page.get_by_role("button", name="Fit all into the picture").dispatch_event("click")
    page.get_by_label("Go to, pan").focus()


def _let_the_picture_follow(page: Page) -> None:
    """Return when a picture is shown that was taken from now on."""
    canvas = page.locator(".picture canvas")
    before = canvas.get_attribute("data-sequence") or ""
    # The next one may have been on its way already.
    for _ in range(2):
        expect(canvas).not_to_have_attribute("data-sequence", before)
        before = canvas.get_attribute("data-sequence") or ""


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


def prepared(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    page.goto(f"{daemon.address}#/calibrate/new")
    expect(page.locator(".checks li").first).to_be_visible()
    expect(page.locator(".chart").first).to_be_visible()
    expect(page.locator(".rate")).to_contain_text("pictures/s")


def calibrated(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    page.goto(f"{daemon.address}#/calibrate")
    expect(page.locator(".result .verdict")).to_be_visible()
    expect(page.locator(".residual").last).to_contain_text("px")
    page.wait_for_load_state("networkidle")


def calibrating(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    api.post("/runs", json={"owner": "anna", "note": "after the move to room 2"}).raise_for_status()
    page.goto(f"{daemon.address}#/calibrate")
    expect(page.locator(".wall li").nth(17)).to_be_visible()
    page.get_by_role("button", name="Pause").click()
    expect(page.get_by_text("Paused: all axes stand")).to_be_visible()
    expect(page.locator(".residual").first).to_contain_text("px")
    page.wait_for_load_state("networkidle")


def cut_off(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    page.goto(f"{daemon.address}#/calibrate")
    expect(page.get_by_role("button", name="Take it up again")).to_be_visible()
    expect(page.locator(".residual").first).to_contain_text("px")
    page.wait_for_load_state("networkidle")


def judged(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    page.goto(f"{daemon.address}#/judge")
    expect(page.get_by_role("img", name=re.compile("Residuals by direction"))).to_be_visible(timeout=120_000)
    expect(page.get_by_role("img", name=re.compile("Picture of view"))).to_be_visible()


def judged_by_views(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    judged(page, daemon, api)
    listed = page.get_by_role("region", name="Views, the worst first").get_by_role("row")
    fitted = listed.filter(has_not_text="held out").get_by_label(re.compile("Drop view"))
    fitted.or_(listed.get_by_label(re.compile("Drop view")).last).first.check()
    _scroll_to(page, "Views")


def judged_by_residuals(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    judged(page, daemon, api)
    _scroll_to(page, "Residuals")


def beside_another(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    entries = api.get("/calibrations").json()
    if len(entries) < 2:
        _follow(api, api.post(f"/runs/{entries[0]['run_id']}/solve", json={"leave_out": [21]}).json()["id"])
        entries = api.get("/calibrations").json()
    page.goto(f"{daemon.address}#/judge/{entries[0]['id']}/{entries[1]['id']}")
    expect(page.get_by_text("What differs, in numbers")).to_be_visible()


def _scroll_to(page: Page, heading: str) -> None:
    header = page.locator("header").bounding_box()
    panel = page.get_by_role("region", name=heading, exact=True).bounding_box()
    assert header is not None
    assert panel is not None
    page.evaluate(f"window.scrollBy(0, {panel['y'] - header['height'] - 12})")


def takeaway(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    page.goto(f"{daemon.address}#/takeaway")
    expect(page.get_by_role("link", name="rig.urdf")).to_be_visible()


def gone(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    ready(page, daemon, api)
    daemon.kill()
    expect(page.get_by_role("alert")).to_contain_text("The daemon does not answer")


def in_3d(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    homed(page, daemon, api)
    _scroll_to(page, "Rig in 3-D")  # it is asked for where it is looked at
    page.get_by_text("As a table").click()
    expect(page.get_by_role("row", name="camera main")).to_be_visible()
    _scroll_to(page, "Rig in 3-D")


def asked_for_a_key(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    page.goto(daemon.address)
    expect(page.get_by_label("Key")).to_be_focused()


def seen_by_a_viewer(page: Page, daemon: Daemon, api: httpx.Client) -> None:
    asked_for_a_key(page, daemon, api)
    page.get_by_label("Key").fill(daemon.keys["viewer"])
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_text("it sees everything and changes nothing")).to_be_visible()
    expect(page.locator(".rate")).to_contain_text("pictures/s")


STATES: Final[dict[str, State]] = {
    "rig": ready,
    "rig-homed": homed,
    "rig-3d": in_3d,
    "rig-coverage": covered,
    "rig-held": held_by_another,
    "rig-stopped": stopped,
    "calibrate": prepared,
    "calibrated": calibrated,
    "judge": judged,
    "judge-views": judged_by_views,
    "judge-residuals": judged_by_residuals,
    "judge-beside": beside_another,
    "calibrating": calibrating,
    "calibrating-cut-off": cut_off,
    "takeaway": takeaway,
    "gone": gone,
}
GUARDED: Final[dict[str, State]] = {"key": asked_for_a_key, "viewer": seen_by_a_viewer}
"""Where keys are asked for."""

DOCUMENTED: Final = ("rig-homed", "calibrate", "calibrating", "calibrated", "judge-views")
"""Those that the documentation shows."""
DOCUMENTATION: Final = Path(__file__).parents[2] / "docs" / "screenshots"
SHOWN: Final = 1080
"""Their width there (px)."""
STEPS: Final = 5
"""To how many levels of 255 their colours are rounded: a camera's noise takes most of the bytes, and shows nothing."""


def main(folder: Path, wanted: Collection[str]) -> None:
    """Take them into `folder`, and give the documentation its own."""
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as data, chromium() as browser:
        daemon = Daemon(Path(data), "paper-table")
        daemon.start()
        with httpx.Client(base_url=f"{daemon.address}api/v1", timeout=60) as api:
            _calibrate(api)
            for name, state in _chosen(STATES, wanted):
                _take(browser, daemon, api, state, folder / name)
        daemon.stop()
    with TemporaryDirectory() as data, chromium() as browser:
        daemon = Daemon(Path(data), "paper-table", keys=True)
        for role in ("viewer", "admin"):
            daemon.make_key(role)
        admin = {"Authorization": f"Bearer {daemon.keys['admin']}"}
        daemon.start()  # which knows of them from its beginning
        with httpx.Client(base_url=f"{daemon.address}api/v1", timeout=60, headers=admin) as api:
            for name, state in _chosen(GUARDED, wanted):
                _take(browser, daemon, api, state, folder / name)
        daemon.stop()
    DOCUMENTATION.mkdir(exist_ok=True)
    for name in DOCUMENTED:
        picture = folder / f"{name}-{WIDTHS[0]}-light.png"
        if picture.exists():
            _shrink(picture, DOCUMENTATION / f"{name}.png")


def _chosen(states: dict[str, State], wanted: Collection[str]) -> list[tuple[str, State]]:
    """Return those of the states that are wanted: all, where none is named."""
    return [(name, state) for name, state in states.items() if not wanted or name in wanted]


def _shrink(picture: Path, to: Path) -> None:
    """Write a picture smaller."""
    with Image.open(picture) as opened:
        smaller = opened.convert("RGB")
    smaller.thumbnail((SHOWN, SHOWN))
    rounded = smaller.point([round(level / STEPS) * STEPS for level in range(256)] * 3)
    rounded.quantize(256, dither=Image.Dither.NONE).save(to, optimize=True)


def _calibrate(api: httpx.Client) -> None:
    run = api.post("/runs", json={"owner": "anna", "note": "after the move to room 2"}).json()["id"]
    _follow(api, run)


def _follow(api: httpx.Client, run: str) -> None:
    with api.stream("GET", f"/runs/{run}/events", timeout=600) as events:
        events.read()


def _take(browser: Browser, daemon: Daemon, api: httpx.Client, state: State, file: Path) -> None:
    """Take pictures of a state, from its beginning each time."""
    for width, scheme in itertools.product(WIDTHS, SCHEMES):
        if not daemon.running:
            daemon.start()
        run = api.get("/rig").json()["run"]
        if run is not None:
            api.post(f"/runs/{run}/cancel").raise_for_status()
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
    main(Path(sys.argv[1]), sys.argv[2:])
