"""No number is without its unit: in tables, figures and legends, of a rig in mm and degrees and of one in counts."""

import re
from collections.abc import Callable, Iterator

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.browser.daemons import Daemon
from tests.browser.test_judging import calibrate, quick_rig

Open = Callable[..., Page]

PURE = {"Positions", "Points", "Views of the fit", "Direction", "In stds", "In standard deviations"}
"""Columns of numbers that have no unit."""
PURE_PARAMETERS = re.compile(r"(.*: )?(axis, [xyz]|[kp]\d)")
IN_HEADING = re.compile(r"\((mm|°|mrad|px)\)|%")
BESIDE = re.compile(
    r"\u00a0(mm|px|mrad|counts|min|s|B|kB|MB)\b|°| %| (s|points|times|views|GB)\b| (to|–) [−\d.]+(\u00a0|°)"
)
NUMBERS = """selectors => [...document.querySelectorAll(selectors)].map(each => each.textContent)"""
CELLS = """() => [...document.querySelectorAll("main table")].flatMap(table => {
  const heads = [...table.tHead.rows[0].cells].map(cell => cell.textContent);
  return [...table.tBodies[0].rows].flatMap(({ cells }) => [...cells].map((cell, i) =>
    [heads[i], cell.textContent.trim(), cells[0].textContent, cells[heads.indexOf("Unit")]?.textContent ?? ""]));
})"""
SHOWN = (
    ".position, .scaled, .travel span, .ends span, .chart figcaption, .coverage-bar .number, .scene p.hint,"
    " .residual, .wall .where, .judge-figures dd, .judge figcaption, .exports .size"
)


@pytest.fixture(scope="module", params=["small", "counts"])
def daemon(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A rig that is calibrated, once in mm and degrees and once in its motors' counts."""
    folder = tmp_path_factory.mktemp("rig")
    daemon = quick_rig(folder) if request.param == "small" else Daemon(folder, "pan-tilt")
    daemon.start()
    with httpx.Client(base_url=f"{daemon.address}api/v1", timeout=120) as api:
        calibrate(api)
    yield daemon
    daemon.stop()


def bare(page: Page) -> list[str]:
    """Return what is shown as a number and nothing more, and where."""
    found = []
    for head, text, name, unit in page.evaluate(CELLS):
        is_number = re.fullmatch(r"[±−\d][−\d.,\s]*", text)
        is_pure = head in PURE or PURE_PARAMETERS.fullmatch(name)
        if is_number and not (is_pure or unit or IN_HEADING.search(head)):
            found.append(f"{name}, {head}: {text}")
    for text in page.evaluate(NUMBERS, SHOWN):
        without_names = re.sub(r"View \d+|0 fits", "", text)
        numbers = re.finditer(r"(?<![\w.,])[\d.,]*\d", without_names)
        found += [f"{each[0]} in: {text}" for each in numbers if not BESIDE.match(without_names, each.end())]
    return found


def test_every_number_has_its_unit_in_each_section(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.address)
    page.get_by_label("Coverage").check()
    expect(page.get_by_role("meter").first).to_be_visible()
    open_scene_table(page)
    assert bare(page) == []
    for path, there in (
        ("#/calibrate", page.locator(".residual").last.filter(has_text="px")),
        ("#/calibrate/new", page.get_by_role("row", name="to calibrate from").first),
        ("#/judge", page.get_by_role("img", name=re.compile("Residuals by place"))),
        ("#/takeaway", page.get_by_role("link", name="rig.urdf")),
    ):
        page.goto(f"{daemon.address}{path}")
        expect(there).to_be_visible()
        assert page.evaluate(NUMBERS, SHOWN) != []
        assert bare(page) == [], path


def test_a_comparison_has_its_units_too(daemon: Daemon, open_page: Open) -> None:
    with httpx.Client(base_url=f"{daemon.address}api/v1", timeout=120) as api:
        [entry, *_] = api.get("/calibrations").json()
    page = open_page(f"{daemon.address}#/judge/{entry['id']}/{entry['id']}")
    page.get_by_text("What differs, in numbers").click()
    expect(page.get_by_role("columnheader", name="Rotation (mrad)")).to_be_visible()
    assert bare(page) == []


@pytest.mark.parametrize("width", [1440, 800])
def test_nothing_reaches_beyond_the_screen(daemon: Daemon, open_page: Open, width: int) -> None:
    page = open_page(daemon.address, viewport={"width": width, "height": 900})
    open_scene_table(page)
    assert beyond(page) == 0
    page.goto(f"{daemon.address}#/calibrate")
    page.locator(".wall button").first.click()
    picture = page.get_by_role("figure", name="Enlarged view").get_by_role("img")
    picture.evaluate("image => image.decode()")
    assert beyond(page) == 0
    for path, there in (
        ("#/calibrate/new", page.get_by_role("row", name="to calibrate from").first),
        ("#/takeaway", page.get_by_role("link", name="rig.urdf")),
    ):
        page.goto(f"{daemon.address}{path}")
        expect(there).to_be_visible()
        assert beyond(page) == 0


def open_scene_table(page: Page) -> None:
    """Open the table of the rig in 3-D, which is asked for only while it is in sight."""
    summary, heading = page.get_by_text("As a table"), page.get_by_role("heading", name="Rig in 3-D")
    while not summary.is_visible():
        heading.scroll_into_view_if_needed()  # again, where the picture above has come and has moved it
        page.wait_for_timeout(50)
    summary.click()
    expect(page.get_by_role("row", name="base")).to_be_visible()


def beyond(page: Page) -> int:
    """Return how many pixels are out of sight to the right."""
    document: dict[str, int] = page.evaluate(
        "(({ scrollWidth, clientWidth }) => ({ scrollWidth, clientWidth }))(document.documentElement)"
    )
    return document["scrollWidth"] - document["clientWidth"]


def test_counts_stand_beside_what_they_are_worth(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.address)
    with httpx.Client(base_url=f"{daemon.address}api/v1") as api:
        rig = api.get("/rig").json()
        [entry] = api.get("/calibrations").json()
        joints = api.get(f"/calibrations/{entry['id']}").json()["calibration"]["joints"]
    for axis, joint in zip(rig["axes"], joints, strict=True):
        scaled = page.get_by_role("article", name=f"Axis {axis['name']}").locator(".scaled")
        if axis["unit"] != "counts":
            expect(scaled).to_be_hidden()  # what is shown is in mm and degrees already
            continue
        expect(scaled).to_be_visible()
        shown = float((scaled.text_content() or "").strip("≈ °").replace("−", "-"))
        assert shown == pytest.approx(axis["position"] * joint["scale"] * 57.29578, abs=0.03)


def test_parameters_have_names_for_people_and_measures_in_mm_and_degrees(
    daemon: Daemon, open_page: Open
) -> None:
    page = open_page(daemon.address)
    told = page.evaluate("""async () => {
      const { labelOf, shown } = await import(new URL("page/paper_tables.js", document.baseURI));
      return [
        ["half_gap", "once_per_turn.sine", "coupling.slide", "warp.xx", "axis.z"].map(labelOf),
        [shown(0.0004, 0.00002, "m"), shown(0.02, 0.001, "deg"), shown(-0.1, 0.01, "rad"), shown(0.5, null, "")],
      ];
    }""")
    assert told[0] == [
        "half the backlash",
        "error once per turn, sine",
        "share of slide that it follows",
        "height of the shape xx",
        "axis, z",
    ]
    assert told[1] == [
        ["0.400", "0.020", "mm"],
        ["0.0200", "0.0010", "°"],
        ["−5.73", "0.57", "°"],
        ["0.500000", "–", ""],
    ]
