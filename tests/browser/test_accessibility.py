"""Everybody can use it: no violation that axe finds, in light and dark; and all of it with the keyboard alone."""

import json
from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.browser.daemons import Daemon

Open = Callable[..., Page]


def violations(page: Page, axe: str) -> list[str]:
    """Return what axe finds wrong, each with the elements that are."""
    page.evaluate(axe)
    found: list[dict[str, Any]] = page.evaluate(
        "axe.run({ resultTypes: ['violations'] }).then(result => result.violations)"
    )
    return [
        f"{each['id']}: {each['help']}: {json.dumps([node['html'] for node in each['nodes']])}"
        for each in found
    ]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_wrong_with_any_section(
    daemon: Daemon, open_page: Open, axe: str, scheme: str
) -> None:
    # Playwright runs scripts of its own past the policy of the page.
    page = open_page(daemon.address, color_scheme=scheme, bypass_csp=True)
    expect(page.locator("canvas").first).to_have_attribute("data-points", "20")
    links = page.get_by_role("navigation").get_by_role("link")
    for link in links.all():
        link.click()
        expect(link).to_have_attribute("aria-current", "page")
        expect(page.get_by_role("main").get_by_role("heading").first).to_be_visible()
        assert violations(page, axe) == [], link.text_content()
    page.keyboard.press("Escape")
    expect(page.get_by_role("button", name="Acknowledge")).to_be_visible()
    links.first.click()
    expect(page.get_by_text("acknowledge that first")).to_be_visible()
    assert violations(page, axe) == []
    page.get_by_role("button", name="Acknowledge").click()
    expect(page.get_by_role("button", name="Acknowledge")).to_be_hidden()


def test_all_of_it_is_reached_by_the_tab_key_and_done_by_enter(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.address)
    expect(page.get_by_role("button", name="Home pan", exact=True)).to_be_enabled()
    names: list[str] = []
    while len(names) < 60:
        page.keyboard.press("Tab")
        name: str = page.evaluate(
            "(document.activeElement.ariaLabel ?? document.activeElement.textContent).trim()"
        )
        names.append(name)
        if name == "Homepan":
            break
        names.append(page.evaluate("document.activeElement.textContent").strip())
        if "Home pan" in names[-1]:
            break
    reached = " | ".join(names)
    for wanted in (
        "Skip to the content",
        "Rig",
        "Take control",
        "STOP",
        "Jog slide",
        "Step of slide",
        "Go to, slide",
    ):
        assert wanted in reached
    page.keyboard.press("Enter")
    expect(page.get_by_role("article", name="Axis pan").locator(".condition")).to_have_text("homed")
