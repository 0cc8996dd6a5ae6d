"""What a calibration is taken away as, by those who click: every file comes, under its name, and is what it says."""

import json
import zipfile
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import cv2
import httpx
import pypdfium2
import pytest
import yaml
from playwright.sync_api import Page, expect

from calib import load_calibration
from daemon.export import EXPORTS
from tests.browser.daemons import Daemon
from tests.browser.test_accessibility import violations
from tests.daemon.export.test_report import Page as Html
from tests.daemon.export.test_urdf import robot_of
from tests.daemon.rigs import write_profile

Open = Callable[..., Page]


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon with two calibrations of one rig, of which the later is in use."""
    folder = tmp_path_factory.mktemp("calibrated")
    daemon = Daemon(folder, str(write_profile(folder)))
    daemon.start()
    with httpx.Client(base_url=f"{daemon.address}api/v1", timeout=120) as api:
        for note in ("the first", "the second"):
            run = api.post("/runs", json={"note": note}).json()["id"]
            with api.stream("GET", f"/runs/{run}/events") as events:
                events.read()
    yield daemon
    daemon.stop()


def calibrations(daemon: Daemon) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = httpx.get(f"{daemon.address}api/v1/calibrations").json()
    return found


def test_each_file_is_downloaded_and_can_be_read(calibrated: Daemon, open_page: Open, tmp_path: Path) -> None:
    page = open_page(f"{calibrated.address}#/takeaway")
    expect(page.get_by_role("list", name="Files").get_by_role("link")).to_have_count(len(EXPORTS))
    files = {}
    for export in EXPORTS:
        with page.expect_download(timeout=120_000) as download:
            page.get_by_role("link", name=export.name, exact=True).click()
        assert download.value.suggested_filename.endswith(f"-{export.name}")
        files[export.name] = tmp_path / export.name
        download.value.save_as(files[export.name])
    [active] = [each for each in calibrations(calibrated) if each["active"]]
    stored = httpx.get(f"{calibrated.address}api/v1/calibrations/{active['id']}").json()["calibration"]
    assert json.loads(files["calibration.json"].read_bytes()) == stored
    assert load_calibration(files["calibration.json"]).quality.verdict == active["verdict"]
    with zipfile.ZipFile(files["session.zip"]) as archive:
        assert archive.testzip() is None
        assert archive.namelist()[0] == f"{active['run_id']}/session.json"
    assert set(robot_of(files["rig.urdf"].read_bytes()).joint_map) >= {"slide", "pan"}
    assert yaml.safe_load(files["camera_info.yaml"].read_bytes())["distortion_model"] == "plumb_bob"
    storage = cv2.FileStorage(str(files["opencv.yaml"]), cv2.FILE_STORAGE_READ)
    assert storage.getNode("camera_matrix").mat().shape == (3, 3)
    storage.release()
    with closing(pypdfium2.PdfDocument(files["report.pdf"])) as document:
        assert len(document) >= 3
    report = Html(files["report.html"].read_bytes())
    assert report.open == []
    assert active["verdict"] in "".join(report.words)


def test_another_calibration_is_chosen_and_one_without_its_session_says_so(
    calibrated: Daemon, open_page: Open
) -> None:
    [older] = [each for each in calibrations(calibrated) if not each["active"]]
    page = open_page(f"{calibrated.address}#/takeaway")
    page.get_by_label("Calibration").select_option(older["id"])
    expect(page).to_have_url(f"{calibrated.address}#/takeaway/{older['id']}")
    link = page.get_by_role("link", name="rig.urdf")
    expect(link).to_have_attribute(
        "href", f"{calibrated.address}api/v1/calibrations/{older['id']}/exports/rig.urdf"
    )
    [session] = calibrated.data.glob(f"sessions/{older['run_id']}/session.json")
    session.rename(session.with_name("gone.json"))
    page.reload()
    expect(page.get_by_text("It cannot be had: there is no session.json")).to_be_visible()
    expect(page.get_by_role("list", name="Files").get_by_role("link")).to_have_count(len(EXPORTS) - 1)
    session.with_name("gone.json").rename(session)


def test_axe_finds_nothing_wrong_with_the_files(calibrated: Daemon, open_page: Open, axe: str) -> None:
    page = open_page(f"{calibrated.address}#/takeaway", bypass_csp=True)
    expect(page.get_by_role("link", name="rig.urdf")).to_be_visible()
    assert violations(page, axe) == []


def test_before_the_first_calibration_it_says_what_will_be_here(daemon: Daemon, open_page: Open) -> None:
    page = open_page(f"{daemon.address}#/takeaway")
    expect(page.get_by_text("Nothing is calibrated yet")).to_be_visible()
