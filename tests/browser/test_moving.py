"""Looking at the rig and moving it: with the mouse, with the keyboard, and stopping it."""

from collections.abc import Callable, Iterator

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.browser.daemons import Daemon

expect.set_options(timeout=20_000)
Open = Callable[..., Page]


@pytest.fixture
def api(daemon: Daemon) -> Iterator[httpx.Client]:
    """The same daemon without the page; nothing is latched, and nobody moves."""
    with httpx.Client(base_url=f"{daemon.address}api/v1", timeout=20) as client:
        client.post("/stop/acknowledge")
        yield client


def test_the_picture_is_live_and_the_target_is_drawn_on_it(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.address)
    expect(page.locator("#connection")).to_have_text("Connected")
    expect(page.locator("canvas").first).to_have_attribute("data-points", "20")
    expect(page.get_by_text("The target is seen")).to_be_visible()
    expect(page.locator(".rate")).to_contain_text("pictures/s")
    page.get_by_label("Show the target").uncheck()
    expect(page.locator("canvas").first).to_have_attribute("data-points", "0")


def test_home_jog_and_go_to(daemon: Daemon, open_page: Open, api: httpx.Client) -> None:
    page = open_page(daemon.address)
    pan = page.get_by_role("article", name="Axis pan")
    pan.get_by_role("button", name="Home").click()
    expect(page.locator("#lease")).to_contain_text("You may move")
    expect(pan.locator(".condition")).to_have_text("homed")
    expect(pan.locator(".position")).to_have_text("0.00°")
    pan.get_by_role("button", name="Jog pan forwards").click()
    expect(pan.locator(".position")).to_have_text("1.00°")
    pan.get_by_label("Go to, pan").fill("-12.5")
    pan.get_by_role("button", name="Go with pan").click()
    expect(pan.locator(".position")).to_have_text("−12.50°")
    axis = api.get("/rig").json()["axes"][1]
    assert axis["position"] == pytest.approx(-12.5, abs=axis["tolerance"])


def test_stop_and_acknowledge(daemon: Daemon, open_page: Open, api: httpx.Client) -> None:
    page = open_page(daemon.address)
    page.get_by_role("button", name="STOP").click()
    expect(page.get_by_role("region", name="Stop")).to_contain_text(
        "Nothing moves until this is acknowledged"
    )
    assert api.get("/rig").json()["stop"]["latched"]
    expect(page.get_by_role("button", name="Home pan", exact=True)).to_be_disabled()
    page.get_by_role("button", name="Acknowledge").click()
    expect(page.get_by_role("button", name="Home pan", exact=True)).to_be_enabled()
    assert not api.get("/rig").json()["stop"]["latched"]
