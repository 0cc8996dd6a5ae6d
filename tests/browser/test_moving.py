"""Looking at the rig and moving it: with the mouse, with the keyboard, and stopping it."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import httpx
import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.daemons import Daemon

Open = Callable[..., Page]


@pytest.fixture
def api(daemon: Daemon) -> Iterator[httpx.Client]:
    """The same daemon without the page: nothing is latched, nobody has control, and all is homed."""
    with httpx.Client(base_url=f"{daemon.address}api/v1", timeout=60) as client:
        client.post("/stop/acknowledge")
        lease = client.post("/lease", json={"owner": "the test", "take_over": True}).json()
        shown = {"X-Lease": lease["token"]}
        for axis in client.get("/rig").json()["axes"]:
            if not axis["homed"]:
                client.post(f"/axes/{axis['name']}/home?wait=true", headers=shown).raise_for_status()
        client.post(
            "/axes/move?wait=true", json={"targets": {"slide": 5, "pan": 0}}, headers=shown
        ).raise_for_status()
        client.delete("/lease", headers=shown)
        yield client


def axis(api: httpx.Client, name: str) -> dict[str, Any]:
    return next(each for each in api.get("/rig").json()["axes"] if each["name"] == name)


def card(page: Page, name: str) -> Locator:
    return page.get_by_role("article", name=f"Axis {name}")


def stands(api: httpx.Client, name: str) -> float:
    """Return where an axis stands, once it does."""
    while (found := axis(api, name))["moving"]:
        pass
    position: float = found["position"]
    return position


@contextmanager
def short_presses(page: Page) -> Iterator[None]:
    """Let presses count as short ones, however long a busy machine takes to let go."""
    page.evaluate("""() => {
      const later = window.hurried = window.setTimeout;
      window.setTimeout = (act, after, ...rest) => later(act, after === 300 ? 60_000 : after, ...rest);
    }""")
    yield
    page.evaluate("window.setTimeout = window.hurried")


def test_the_picture_is_live_and_the_target_is_drawn_on_it(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.address)
    expect(page.locator("#connection")).to_have_text("Connected")
    expect(page.locator("canvas").first).to_have_attribute("data-points", "20")
    expect(page.get_by_text("The target is seen")).to_be_visible()
    expect(page.locator(".rate")).to_contain_text("pictures/s")
    page.get_by_label("Target", exact=True).uncheck()
    expect(page.locator("canvas").first).to_have_attribute("data-points", "0")


def test_readings_are_shown_in_mm_and_degrees(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.address)
    shown = page.evaluate("""async () => {
      const { measureOf, quantity, reading } = await import(new URL("page/units.js", document.baseURI));
      const axis = (kind, unit, tolerance) => ({ kind, unit, tolerance });
      return [
        reading(-0.5, axis("revolute", "rad", 0.001)),
        reading(1.25, axis("prismatic", "m", 0.0001)),
        reading(-0.001, axis("revolute", "deg", 0.05)),
        reading(-81920, axis("revolute", "counts", 4)),
        reading(null, axis("prismatic", "mm", 0.05)),
        quantity(3.14159, "px", 1),
        measureOf(axis("prismatic", "deg", 1)).unit,
      ];
    }""")
    assert shown == ["−28.65°", "1250.0\xa0mm", "0.00°", "−81920\xa0counts", "–", "3.1\xa0px", "deg"]


def test_home_jog_and_go_to(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.address)
    pan = card(page, "pan")
    expect(pan.locator(".condition")).to_have_text("not homed")
    pan.get_by_role("button", name="Home").click()
    expect(page.locator("#lease")).to_contain_text("You have control")
    expect(pan.locator(".condition")).to_have_text("homed")
    with short_presses(page):
        pan.get_by_role("button", name="Jog pan forwards").click()
    expect(pan.locator(".position")).to_have_text("1.00°")
    pan.get_by_label("Go to, pan").fill("-12.5")
    pan.get_by_role("button", name="Go with pan").click()
    expect(pan.locator(".position")).to_have_text("−12.50°")
    page.get_by_label("Go to, slide").fill("400")
    card(page, "slide").get_by_role("button", name="Go with slide").click()
    assert "less than or equal to 100" in page.get_by_label("Go to, slide").evaluate(
        "it => it.validationMessage"
    )


def test_a_jog_that_is_held_goes_on_until_it_is_let_go(
    daemon: Daemon, open_page: Open, api: httpx.Client
) -> None:
    page = open_page(daemon.address)
    slide = card(page, "slide")
    forwards = slide.get_by_role("button", name="Jog slide forwards")
    expect(forwards).to_be_enabled()
    forwards.hover()
    page.mouse.down()
    expect(slide.locator(".condition")).to_have_text("moving")
    while axis(api, "slide")["position"] < 8:
        pass
    page.mouse.up()
    where = stands(api, "slide")
    assert 8 < where < 95
    expect(slide.locator(".condition")).to_have_text("homed")
    # So it does when the page is looked away from.
    page.mouse.down()
    expect(slide.locator(".condition")).to_have_text("moving")
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    assert where <= stands(api, "slide") < 95
    page.mouse.up()


def test_a_finger_on_a_tablet_jogs_for_as_long_as_it_is_there(
    daemon: Daemon, open_page: Open, api: httpx.Client
) -> None:
    page = open_page(daemon.address, viewport={"width": 800, "height": 1200}, has_touch=True)
    forwards = card(page, "slide").get_by_role("button", name="Jog slide forwards")
    expect(forwards).to_be_enabled()
    expect(page.locator("canvas").first).to_have_attribute(
        "data-points", "20"
    )  # above it, with its full height
    forwards.scroll_into_view_if_needed()
    box = forwards.bounding_box()
    assert box is not None
    finger = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
    screen = page.context.new_cdp_session(page)
    screen.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [finger]})
    while axis(api, "slide")["position"] < 8:
        pass
    screen.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    where = stands(api, "slide")
    assert 8 < where < 95
    expect(card(page, "slide").locator(".condition")).to_have_text("homed")  # the page knows that it stands
    with short_presses(page):
        forwards.tap()
    while stands(api, "slide") < where + 0.9:
        pass
    assert stands(api, "slide") == pytest.approx(where + 1, abs=0.2)


def test_a_jog_that_is_held_ends_when_nobody_says_any_more_that_it_is(
    daemon: Daemon, open_page: Open, api: httpx.Client
) -> None:
    page = open_page(daemon.address)
    slide = card(page, "slide").get_by_role("button", name="Jog slide forwards")
    expect(slide).to_be_enabled()
    # A network that has gone silent: nothing of what is sent arrives, and the sockets stay open.
    page.evaluate("""() => {
      const send = WebSocket.prototype.send;
      WebSocket.prototype.send = function (data) { if (!window.silent) send.call(this, data); };
    }""")
    slide.hover()
    page.mouse.down()
    expect(card(page, "slide").locator(".condition")).to_have_text("moving")
    page.evaluate("window.silent = true")
    page.mouse.up()
    assert stands(api, "slide") < 95
    assert "cancelled" in axis(api, "slide")["last_error"]
    assert api.get("/rig").json()["lease"] is None


def test_keys_jog_only_while_the_pad_has_the_focus(
    daemon: Daemon, open_page: Open, api: httpx.Client
) -> None:
    page = open_page(daemon.address)
    pan, slide = card(page, "pan"), card(page, "slide")
    expect(pan.get_by_role("button", name="Home")).to_be_enabled()
    page.keyboard.press("ArrowRight")
    page.get_by_label("Go to, pan").press("ArrowRight")
    assert axis(api, "pan")["position"] == pytest.approx(0, abs=0.05)
    assert api.get("/rig").json()["lease"] is None
    pad = page.get_by_role("application")
    pad.press("ArrowDown")
    expect(pad).to_have_text("Keyboard jog: pan")
    with short_presses(page):
        pad.press("ArrowRight")
    expect(pan.locator(".position")).to_have_text("1.00°")
    # Held, it goes on until the focus is lost.
    pad.press("ArrowUp")
    page.keyboard.down("ArrowRight")
    expect(slide.locator(".condition")).to_have_text("moving")
    page.keyboard.press("Tab")
    assert 5 < stands(api, "slide") < 95
    page.keyboard.up("ArrowRight")


def test_stop_by_the_button_and_by_a_key_wherever_the_focus_is(
    daemon: Daemon, open_page: Open, api: httpx.Client
) -> None:
    page = open_page(daemon.address)
    home = page.get_by_role("button", name="Home pan", exact=True)
    page.get_by_role("button", name="STOP").click()
    expect(page.get_by_role("region", name="Stop")).to_contain_text(
        "Nothing moves until this is acknowledged"
    )
    assert api.get("/rig").json()["stop"]["latched"]
    expect(home).to_be_disabled()
    expect(page.get_by_text("All is stopped: acknowledge that first")).to_be_visible()
    page.get_by_role("button", name="Acknowledge").click()
    expect(home).to_be_enabled()
    assert not api.get("/rig").json()["stop"]["latched"]
    page.get_by_label("Go to, slide").fill("95")
    page.get_by_label("Go to, slide").press("Enter")
    expect(card(page, "slide").locator(".condition")).to_have_text("moving")
    page.get_by_label("Go to, pan").press("Escape")
    expect(home).to_be_disabled()
    assert stands(api, "slide") < 90
    page.get_by_role("button", name="Acknowledge").click()
    expect(home).to_be_enabled()


def test_stop_acts_from_each_of_three_tabs(daemon: Daemon, open_page: Open, api: httpx.Client) -> None:
    tabs = [open_page(daemon.address)]
    tabs += [open_page(daemon.address, beside=tabs[0]) for _ in range(2)]
    for tab in tabs:
        expect(tab.locator("canvas").first).to_have_attribute("data-points", "20")
    tabs[0].get_by_label("Go to, slide").fill("100")
    tabs[0].get_by_label("Go to, slide").press("Enter")
    expect(card(tabs[2], "slide").locator(".condition")).to_have_text("moving")
    tabs[2].keyboard.press("Escape")
    while not api.get("/rig").json()["stop"]["latched"]:
        pass
    assert stands(api, "slide") < 95  # the benchmark `page` says how soon it stands on a quiet machine
    for tab in tabs:
        expect(tab.get_by_role("button", name="Acknowledge")).to_be_visible()


def test_stop_goes_by_http_where_the_socket_is_silent(
    daemon: Daemon, open_page: Open, api: httpx.Client
) -> None:
    page = open_page(daemon.address)
    expect(page.locator("#connection")).to_have_text("Connected")
    page.evaluate("WebSocket.prototype.send = () => {}")
    page.keyboard.press("Escape")
    expect(page.get_by_role("button", name="Acknowledge")).to_be_visible()
    assert api.get("/rig").json()["stop"]["latched"]


def test_control_is_somebody_elses_until_it_is_taken_over(
    daemon: Daemon, open_page: Open, api: httpx.Client
) -> None:
    page = open_page(daemon.address)
    home = page.get_by_role("button", name="Home pan", exact=True)
    expect(home).to_be_enabled()
    api.post("/lease", json={"owner": "anna"})
    expect(home).to_be_disabled()
    expect(page.get_by_text("“anna” has control: wait, or take over")).to_be_visible()
    page.get_by_role("button", name="Take over").click()
    expect(page.locator("#lease")).to_contain_text("You have control")
    expect(home).to_be_enabled()
    page.get_by_role("button", name="Give back").click()
    expect(page.locator("#lease")).to_contain_text("Nobody has control")


def test_coverage_is_a_layer_over_the_picture_that_grows_with_the_run(
    daemon: Daemon, open_page: Open, api: httpx.Client
) -> None:
    page = open_page(daemon.address)
    page.get_by_label("Coverage").check()
    expect(page.get_by_text("There is no run yet")).to_be_visible()
    run = api.post("/runs", json={}).json()["id"]
    with api.stream("GET", f"/runs/{run}/events") as events:
        next(line for line in events.iter_lines() if line == "event: view")
    expect(page.get_by_text(re.compile(rf"\d+ views? of run {run}"))).to_be_visible()
    api.post(f"/runs/{run}/cancel")
    size = page.get_by_role("meter", name="Size: How large")
    assert 10 < int(size.get_attribute("aria-valuenow") or 0) <= 100
    page.get_by_label("Coverage").uncheck()
    expect(size).to_be_hidden()


def test_a_tab_that_is_closed_moves_nothing_any_more(
    daemon: Daemon, open_page: Open, api: httpx.Client
) -> None:
    page = open_page(daemon.address)
    page.get_by_label("Go to, slide").fill("100")
    page.get_by_label("Go to, slide").press("Enter")
    expect(card(page, "slide").locator(".condition")).to_have_text("moving")
    page.close()
    assert stands(api, "slide") < 95
    assert api.get("/rig").json()["lease"] is None
