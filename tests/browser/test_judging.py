"""Judging a calibration: its verdict, its views, solving again without some of them, and comparing."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.browser.daemons import Daemon
from tests.daemon.rigs import write_profile

Open = Callable[..., Page]


def calibrate(api: httpx.Client) -> dict[str, Any]:
    """Run the procedure, and return the run when it is over."""
    run = api.post("/runs", json={"note": "before the page is opened"}).json()
    with api.stream("GET", f"/runs/{run['id']}/events") as events:
        for _ in events.iter_lines():
            pass
    done: dict[str, Any] = api.get(f"/runs/{run['id']}").json()
    assert done["state"] == "succeeded", done["error"]
    return done


def quick_rig(folder: Path, *, keys: bool = False) -> Daemon:
    """Return a daemon on a rig that is calibrated in some seconds."""
    return Daemon(folder, str(write_profile(folder)), keys=keys)


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    daemon = quick_rig(tmp_path_factory.mktemp("rig"))
    daemon.start()
    yield daemon
    daemon.stop()


@pytest.fixture(scope="module")
def api(daemon: Daemon) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{daemon.address}api/v1", timeout=60) as api:
        yield api


@pytest.fixture(scope="module")
def run(api: httpx.Client) -> dict[str, Any]:
    return calibrate(api)


@pytest.fixture
def judge(daemon: Daemon, run: dict[str, Any], open_page: Open) -> Page:
    """The section, with all that it shows of the run's calibration."""
    return shown(open_page(f"{daemon.address}#/judge/{run['calibration_id']}"))


def shown(page: Page) -> Page:
    expect(page.get_by_role("img", name=re.compile("Residuals by direction"))).to_be_visible()
    return page


def test_a_rig_that_is_not_calibrated_says_so(
    tmp_path_factory: pytest.TempPathFactory, open_page: Open
) -> None:
    daemon = Daemon(tmp_path_factory.mktemp("new"))
    daemon.start()
    try:
        page = open_page(f"{daemon.address}#/judge")
        expect(page.get_by_text("Nothing is calibrated yet")).to_be_visible()
    finally:
        daemon.stop()


def test_the_verdict_comes_first_and_then_what_it_rests_on(
    judge: Page, api: httpx.Client, run: dict[str, Any]
) -> None:
    headings = judge.locator("main h2").all_text_contents()
    assert headings == [
        "Verdict",
        "Predicted against measured",
        "What would help most",
        "Views",
        "Residuals",
        "The paper’s tables, for this rig",
        "Parameters",
        "All calibrations",
    ]
    entry = api.get(f"/calibrations/{run['calibration_id']}").json()
    quality = entry["calibration"]["quality"]
    verdict = judge.get_by_role("region", name="Verdict", exact=True)
    expect(verdict).to_contain_text(entry["judgement"].capitalize())
    sentence = entry["verdict"].partition(": ")[2]
    expect(verdict).to_contain_text(sentence[0].upper() + sentence[1:])
    expect(verdict).to_contain_text("In use")
    figures = judge.get_by_role("region", name="Predicted against measured")
    expect(figures).to_contain_text(f"{quality['held_out_rms_px']:.3g}"[:6])
    for warning in quality["warnings"]:
        expect(judge.get_by_role("region", name="What would help most")).to_contain_text(warning[1:])
    parameters = judge.get_by_role("region", name="pan", exact=True)
    expect(parameters.get_by_role("row", name=re.compile("^scale"))).to_contain_text("rad/deg")


def test_the_papers_tables_stand_beside_ours_or_it_is_said_why_not(judge: Page) -> None:
    tables = judge.get_by_role("region", name="The paper’s tables, for this rig")
    expect(tables).to_contain_text("No joint moved alone in the held-out views")


def test_residuals_are_of_the_views_that_are_chosen(judge: Page) -> None:
    direction = judge.get_by_role("img", name=re.compile("Residuals by direction"))
    expect(direction).to_have_attribute("aria-label", re.compile("200 points, rms 0.0"))
    judge.get_by_label("Show", exact=True).select_option("views of pan")
    expect(direction).to_have_attribute("aria-label", re.compile("80 points, rms 0.0"))
    judge.get_by_label("Show", exact=True).select_option("held-out views")
    expect(direction).to_have_attribute("aria-label", re.compile("40 points, rms 0.0"))


def test_the_worst_views_come_first_and_each_can_be_looked_at(
    judge: Page, api: httpx.Client, run: dict[str, Any]
) -> None:
    views = judge.get_by_role("region", name="Views, the worst first")
    found = api.get(f"/runs/{run['id']}/views").json()["views"]
    worst = sorted(found, key=lambda view: -(view["held_out_px"] or view["residual_px"]))
    names = views.get_by_role("button", name=re.compile(r"View \d+"))
    assert names.all_text_contents() == [f"View {view['number']}" for view in worst[:8]]
    pictured = judge.get_by_role("img", name=re.compile("Picture of view"))
    expect(pictured).to_have_attribute("aria-label", re.compile(f"view {worst[0]['number']}: 20 points"))
    fourth = views.get_by_role("button", name=f"View {worst[3]['number']}", exact=True)
    fourth.press("Enter")
    expect(pictured).to_have_attribute(
        "aria-label", re.compile(f"view {worst[3]['number']}: 20 points, rms 0.0")
    )
    expect(fourth).to_be_focused()
    judge.get_by_role("button", name="Show all 10 views").click()
    expect(names).to_have_count(10)


def test_it_is_said_that_dropping_held_out_views_alone_leaves_the_calibration_as_it_is(
    judge: Page, api: httpx.Client, run: dict[str, Any]
) -> None:
    judge.get_by_role("button", name="Show all 10 views").click()
    views = api.get(f"/runs/{run['id']}/views").json()["views"]
    held_out, fitted = (
        next(view["number"] for view in views if view["use"] == use) for use in ("verify", "fit")
    )
    hint = judge.get_by_text("without these alone")
    expect(hint).to_be_hidden()
    judge.get_by_label(f"Drop view {held_out}", exact=True).check()
    expect(hint).to_be_visible()
    judge.get_by_label(f"Drop view {fitted}", exact=True).check()
    expect(hint).to_be_hidden()


def test_views_are_dropped_solved_without_compared_and_the_better_one_used_with_the_keyboard_alone(
    judge: Page, api: httpx.Client, run: dict[str, Any]
) -> None:
    judge.get_by_role("button", name="Show all 10 views").press("Enter")
    again = judge.get_by_role("button", name=re.compile("Solve again"))
    expect(again).to_be_disabled()
    for number in (1, 6):
        judge.get_by_label(f"Drop view {number}", exact=True).press("Space")
    expect(again).to_have_text("Solve again without 2 views")
    again.press("Enter")

    beside = judge.get_by_role("region", name="Side by side")
    expect(beside).to_contain_text("They agree")
    new, old = beside.get_by_role("article", name="This one"), beside.get_by_role("article", name="The other")
    expect(new).to_contain_text("2 views left out by hand")
    expect(new.locator(".facts")).to_contain_text("view 1, view 6")
    expect(old).to_contain_text("In use")
    beside.get_by_text("What differs, in numbers").press("Enter")
    differing = beside.get_by_role("region", name=re.compile("Parameters that differ most"))
    expect(differing.get_by_role("row")).to_have_count(11)  # the head, and ten
    shown(judge)
    judge.get_by_role("button", name="Show all 10 views").click()
    expect(judge.get_by_label("Drop view 6", exact=True)).to_be_checked()

    assert api.get("/calibrations/current").json()["id"] == run["calibration_id"]
    new.get_by_role("button", name="Use this calibration").press("Enter")
    expect(new).to_contain_text("In use")
    solved = api.get(f"/runs/{run['id']}").json()
    assert (solved["state"], api.get("/calibrations/current").json()["id"]) == (
        "succeeded",
        solved["calibration_id"],
    )

    history = judge.get_by_role("region", name="All calibrations", exact=True)
    history.get_by_role("link", name="End the comparison").press("Enter")
    expect(judge.get_by_role("region", name="Verdict", exact=True)).to_contain_text(
        "2 views left out by hand"
    )
    history.get_by_role("link", name=re.compile("Compare with the one of")).click()
    expect(beside).to_contain_text("They agree")
    api.post(f"/calibrations/{run['calibration_id']}/activate")


def test_views_that_cannot_be_done_without_are_said_to_be(judge: Page) -> None:
    judge.get_by_role("button", name="Show all 10 views").click()
    for number in range(7):
        judge.get_by_label(f"Drop view {number}", exact=True).check()
    judge.get_by_role("button", name="Solve again without 7 views").click()
    expect(judge.get_by_text(re.compile("could not be solved: "))).to_be_visible()


def test_a_calibration_that_is_gone_is_said_so(daemon: Daemon, run: dict[str, Any], open_page: Open) -> None:
    page = open_page(f"{daemon.address}#/judge/none")
    expect(page.get_by_role("alert")).to_contain_text("there is no calibration 'none'")


def test_a_viewer_sees_everything_and_changes_nothing(
    tmp_path_factory: pytest.TempPathFactory, open_page: Open
) -> None:
    daemon = quick_rig(tmp_path_factory.mktemp("asked"), keys=True)
    for role in ("operator", "viewer"):
        daemon.make_key(role)
    daemon.start()
    try:
        headers = {"Authorization": f"Bearer {daemon.keys['operator']}"}
        with httpx.Client(base_url=f"{daemon.address}api/v1", timeout=60, headers=headers) as api:
            calibrate(api)
        page = open_page(f"{daemon.address}#/judge")
        page.get_by_label("Key").fill(daemon.keys["viewer"])
        page.get_by_role("button", name="Sign in").click()
        shown(page)
        page.get_by_label(re.compile("Drop view")).first.check()
        expect(page.get_by_role("button", name="Solve again without 1 view")).to_be_disabled()
        expect(page.get_by_text("it sees everything and changes nothing").first).to_be_visible()
    finally:
        daemon.stop()


@pytest.mark.parametrize(("width", "scheme"), [(1440, "light"), (800, "dark")])
def test_everybody_can_use_it(
    daemon: Daemon, api: httpx.Client, run: dict[str, Any], open_page: Open, axe: str, scheme: str, width: int
) -> None:
    entries = api.get("/calibrations").json()
    other = next(
        (each["id"] for each in entries if each["id"] != run["calibration_id"]), run["calibration_id"]
    )
    for path in (run["calibration_id"], f"{run['calibration_id']}/{other}"):
        page = open_page(
            f"{daemon.address}#/judge/{path}",
            viewport={"width": width, "height": 900},
            color_scheme=scheme,
        )
        shown(page)
        found = page.evaluate(f"{axe}; axe.run()")
        assert [(each["id"], each["nodes"][0]["html"]) for each in found["violations"]] == []
        overflow = page.evaluate(
            "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        )
        assert overflow <= 0
