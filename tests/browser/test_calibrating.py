"""A calibration from the page: from the checklist to the verdict, with the mouse and with the keyboard alone."""

from collections.abc import Callable, Iterator

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.browser.daemons import Daemon
from tests.browser.test_accessibility import violations
from tests.daemon.rigs import write_profile

Open = Callable[..., Page]
VIEWS = 8
"""Of 10 positions; at the ends of the pan's sweep the target is out of the picture."""


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon on a rig that is calibrated in some seconds; what one test leaves, the next one finds."""
    folder = tmp_path_factory.mktemp("quick")
    daemon = Daemon(folder, str(write_profile(folder, time_scale=4.0, reach=20.0)))
    daemon.start()
    yield daemon
    daemon.stop()


@pytest.fixture
def api(daemon: Daemon) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=f"{daemon.address}api/v1", timeout=60) as client:
        yield client


def tab_to(page: Page, name: str) -> None:
    """Press Tab until what is called so has the focus."""
    for _ in range(60):
        page.keyboard.press("Tab")
        focused = page.evaluate(
            "(e => e.ariaLabel ?? e.labels?.[0]?.textContent ?? e.textContent)(document.activeElement)"
        )
        if focused.strip().startswith(name):
            return
    pytest.fail(f"'{name}' is not reached")


NOTE_PAUSES = """() => {
    window.steered = window.paused = false;
    const buttons = () => [...document.querySelectorAll("button")].filter((button) => button.checkVisibility());
    const shown = (name) => buttons().some((button) => button.textContent === name);
    new MutationObserver(() => {
        window.steered ||= shown("Cancel");
        window.paused ||= shown("Pause");
    }).observe(document.body, { subtree: true, childList: true, attributes: true });
}"""
"""Note whether a run could be cancelled, and whether it could be paused."""


def test_before_the_first_calibration_the_rig_in_3d_says_what_is_missing(
    daemon: Daemon, open_page: Open
) -> None:
    page = open_page(daemon.address)
    expect(page.get_by_role("region", name="Rig in 3-D")).to_contain_text("once the rig is calibrated")
    page.goto(f"{daemon.address}#/calibrate/none")
    expect(page.get_by_role("main").get_by_role("alert")).to_contain_text("'none'")


def test_a_calibration_from_the_checklist_to_the_verdict(
    daemon: Daemon, open_page: Open, axe: str, api: httpx.Client
) -> None:
    page = open_page(f"{daemon.address}#/calibrate", bypass_csp=True)
    expect(page.get_by_text("will be homed first")).to_be_visible()
    expect(page.get_by_role("row", name="slide to calibrate from 4 0.00 mm – 100.00 mm")).to_be_visible()
    expect(
        page.get_by_role("img", name="pan: from −20.00° to 20.00°, within −20.00 to 20.00°")
    ).to_be_visible()
    page.get_by_role("button", name="Home all").click()
    expect(page.get_by_text("All axes know where they are")).to_be_visible()
    expect(page.get_by_text("nothing stands against a run")).to_be_visible()
    expect(page.get_by_text("You have control.")).to_be_visible()
    page.get_by_label("Your name").fill("Anna")
    page.get_by_label("Note").fill("from the page")
    page.get_by_role("button", name="Start the calibration").click()

    expect(page.locator(".wall li").first).to_be_visible()
    page.get_by_role("button", name="Pause").click()
    expect(page.get_by_text("Paused: all axes stand")).to_be_visible()
    expect(page.locator("#advance-title + p")).to_contain_text("by Anna: “from the page”")
    taken = page.locator(".wall li").count()
    assert 0 < taken < VIEWS
    expect(page.locator(".left")).to_contain_text("left")
    assert violations(page, axe) == []
    late = open_page(f"{daemon.address}#/calibrate", color_scheme="dark", bypass_csp=True)
    expect(late.locator(".wall li")).to_have_count(taken)
    assert violations(late, axe) == []

    late.get_by_role("button", name="Resume").click()
    expect(page.locator(".wall li")).to_have_count(VIEWS)
    expect(page.locator(".badge", has_text="held out")).to_have_count(2)
    warnings = page.get_by_role("region", name="Warnings").get_by_role("listitem")
    expect(warnings).to_have_count(2)
    expect(warnings.first).to_contain_text("Position 5 of 10 is left out")
    expect(page.get_by_text("2 of 4, 2 without the target")).to_be_attached()
    expect(page.locator(".verdict")).to_contain_text("held-out views are predicted to")
    expect(late.locator(".verdict")).to_be_visible()
    judged = {view["number"]: view["residual_px"] for view in api.get(_views(api)).json()["views"]}
    for number, residual in judged.items():
        card = page.get_by_role("button", name=f"View {number} ")
        expect(card.locator(".residual")).to_have_text(f"{residual:.3f} px")
        assert card.locator("img").evaluate("image => image.decode().then(() => image.naturalWidth)") == 320
    calibration = api.get("/rig").json()["calibration_id"]
    link = page.get_by_role("link", name="Judge this calibration")
    expect(link).to_have_attribute("href", f"#/judge/{calibration}")
    assert violations(page, axe) == []


def test_a_position_that_a_run_was_on_its_way_to_is_not_one_without_the_target(
    daemon: Daemon, open_page: Open
) -> None:
    page = open_page(daemon.address)
    told = page.evaluate("""async () => {
      const { Progress } = await import(new URL("page/progress.js", document.baseURI));
      const progress = new Progress([
        { type: "plan", views: 4, done: 0 },
        { type: "joint", joint: "pan" },
        { type: "moving", position: 1, of: 4, time: "2026-03-14T09:27:01Z" },
        { type: "view", position: 1, view: 0 },
        { type: "moving", position: 2, of: 4, time: "2026-03-14T09:27:02Z" },
        { type: "moving", position: 3, of: 4, time: "2026-03-14T09:27:03Z" },
      ]);
      const under_way = [1, 2, 3, 4].map((position) => progress.at(position));
      progress.tell({ type: "finished", state: "cancelled" });
      return [under_way, [1, 2, 3, 4].map((position) => progress.at(position))];
    }""")
    assert told == [["taken", "unseen", "now", "to come"], ["taken", "unseen", "to come", "to come"]]


def test_a_view_is_enlarged_and_left_with_the_keyboard(daemon: Daemon, open_page: Open) -> None:
    page = open_page(f"{daemon.address}#/calibrate")
    expect(page.locator(".wall li")).to_have_count(VIEWS)
    tab_to(page, "View 7")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    enlarged = page.get_by_role("figure", name="Enlarged view")
    expect(enlarged).to_contain_text("View 6 slide 20.00 mm, pan 5.00°, to verify by")
    page.keyboard.press("ArrowLeft")
    expect(enlarged.get_by_role("img", name="Picture of view 5")).to_be_visible()
    tab_to(page, "Close")
    page.keyboard.press("Enter")
    expect(enlarged).to_be_hidden()
    expect(page.get_by_role("button", name="View 5 ")).to_be_focused()


def test_a_sweep_from_here_is_cancelled_and_taken_up_again_with_the_keyboard_alone(
    daemon: Daemon, open_page: Open, api: httpx.Client
) -> None:
    token = api.post("/lease", json={"owner": "test"}).json()["token"]
    api.post(
        "/axes/slide/move?wait=true", json={"target": 40.0}, headers={"X-Lease": token}
    ).raise_for_status()
    api.delete("/lease", headers={"X-Lease": token})
    page = open_page(f"{daemon.address}#/calibrate/new")
    row = page.get_by_role("row", name="pan to calibrate from")
    expect(row).to_contain_text("slide 50.00 mm")
    tab_to(page, "pan")
    page.keyboard.press("Space")
    expect(row).to_contain_text("slide 40.00 mm")
    page.get_by_role("button", name="STOP").focus()  # the start comes before the plan
    tab_to(page, "Note")
    page.keyboard.type("from here")
    page.keyboard.press("Enter")

    expect(page.locator(".wall li").first).to_be_visible()
    page.get_by_role("button", name="STOP").focus()
    tab_to(page, "Cancel")
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", name="The run was cancelled")).to_be_visible()
    tab_to(page, "Take it up again")
    page.keyboard.press("Enter")
    expect(page.locator(".verdict")).to_be_visible()
    expect(page.locator(".wall li")).to_have_count(VIEWS)
    views = api.get(_views(api)).json()["views"]
    assert [view["readings"][0] for view in views if view["joint"] == "pan"] == pytest.approx(
        [40.0] * 2, abs=0.1
    )


def test_what_was_cut_off_is_solved_as_it_is(daemon: Daemon, open_page: Open, api: httpx.Client) -> None:
    run = api.post("/runs", json={}).json()["id"]
    page = open_page(f"{daemon.address}#/calibrate")
    expect(page.locator(".wall li").nth(5)).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.get_by_role("heading", name="The run failed")).to_be_visible()
    expect(page.get_by_role("button", name="Take it up again")).to_be_disabled()
    page.get_by_role("button", name="Acknowledge").click()
    expect(page.get_by_role("button", name="Take it up again")).to_be_enabled()
    page.evaluate(NOTE_PAUSES)
    page.get_by_role("button", name="Solve it as it is").click()
    expect(page.get_by_role("link", name="Judge this calibration")).to_be_visible()
    assert page.evaluate("[window.steered, window.paused]") == [True, False]
    # A run of the past, as after the daemon was started again, has its own address.
    daemon.stop()
    daemon.start()
    page.goto(f"{daemon.address}#/calibrate/{run}")
    expect(page.locator(".wall li").nth(5)).to_be_visible()
    expect(page.get_by_role("button", name="Solve it as it is")).to_be_enabled()


def test_the_rig_in_3d_is_at_its_readings_and_turns(
    daemon: Daemon, open_page: Open, axe: str, api: httpx.Client
) -> None:
    token = api.post("/lease", json={"owner": "test"}).json()["token"]
    headers = {"X-Lease": token}
    for axis in ("slide", "pan"):
        api.post(f"/axes/{axis}/home?wait=true", headers=headers).raise_for_status()
    page = open_page(daemon.address, bypass_csp=True)
    scene = page.get_by_role("region", name="Rig in 3-D")
    canvas = scene.locator("canvas")
    expect(canvas).to_be_visible()
    expect(scene).to_contain_text("Ellipsoids: one standard deviation")
    scene.get_by_text("As a table").click()
    camera = scene.get_by_role("row", name="camera main")
    before, drawn = camera.text_content(), canvas.evaluate("canvas => canvas.toDataURL()")
    api.post("/axes/slide/move?wait=true", json={"target": 60.0}, headers=headers).raise_for_status()
    expect(camera).not_to_have_text(before or "")
    api.delete("/lease", headers=headers)
    moved = canvas.evaluate("canvas => canvas.toDataURL()")
    assert moved != drawn
    canvas.press("ArrowRight")
    assert canvas.evaluate("canvas => canvas.toDataURL()") != moved
    assert violations(page, axe) == []


def _views(api: httpx.Client) -> str:
    """Return where the views of the latest run are."""
    return f"/runs/{api.get('/runs').json()[0]['id']}/views"
