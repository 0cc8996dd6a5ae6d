"""The page where keys are asked for: signing in, and a viewer who sees everything and moves nothing."""

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.daemons import Daemon
from tests.browser.test_accessibility import violations

Open = Callable[..., Page]


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon that asks for keys, and has one of each role that uses the page."""
    daemon = Daemon(tmp_path_factory.mktemp("guarded"), keys=True)
    for role in ("viewer", "operator"):
        daemon.make_key(role)
    daemon.start()
    yield daemon
    daemon.stop()


def sign_in(page: Page, key: str) -> None:
    page.get_by_label("Key").fill(key)
    page.get_by_role("button", name="Sign in").click()


def test_an_operator_signs_in_moves_and_signs_out(guarded: Daemon, open_page: Open, axe: str) -> None:
    page = open_page(guarded.address, bypass_csp=True)
    expect(page.get_by_label("Key")).to_be_focused()
    assert violations(page, axe) == []
    sign_in(page, "activecam_wrong")
    expect(page.get_by_text("this key is not known here")).to_be_visible()
    sign_in(page, guarded.keys["operator"])
    expect(page.locator("#lease")).to_contain_text("operator, operator")
    assert violations(page, axe) == []
    page.get_by_role("button", name="Home pan", exact=True).click()
    expect(page.get_by_role("article", name="Axis pan").locator(".condition")).to_have_text("homed")
    expect(page.locator("#lease")).to_contain_text("You have control")
    # No script has the key, nor anything that stands for it.
    assert page.evaluate("document.cookie + JSON.stringify(localStorage)") == "{}"
    page.get_by_role("button", name="Sign out").click()
    expect(page.get_by_label("Key")).to_be_visible()


def test_a_viewer_sees_everything_and_moves_nothing(guarded: Daemon, open_page: Open) -> None:
    page = open_page(guarded.address)
    sign_in(page, guarded.keys["viewer"])
    expect(page.locator("canvas").first).to_have_attribute("data-points", "20")
    expect(page.get_by_text("it sees everything and changes nothing")).to_be_visible()
    expect(page.get_by_role("button", name="STOP")).to_be_disabled()
    section = page.get_by_role("main")
    assert section.get_by_role("button").count() > 5
    for control in (*section.get_by_role("button").all(), *section.get_by_role("spinbutton").all()):
        expect(control).to_be_disabled()
    expect(page.get_by_role("button", name="Take")).to_have_count(0)
    page.get_by_role("application").press("ArrowRight")
    page.keyboard.press("Escape")
    expect(page.get_by_text("a key of role 'operator' is needed")).to_be_visible()
    expect(page.get_by_role("region", name="Stop")).to_be_hidden()
