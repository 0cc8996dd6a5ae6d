"""What a daemon's calibrations are taken away as, over HTTP: whole and under the right name, or a sentence why not."""

import html
import io
import json
import zipfile
from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest
import yaml

from calib import load_calibration, load_session, solve
from daemon.api import create_app
from daemon.export import EXPORTS
from daemon.profile import Profile
from daemon.service import Service, running_service
from tests.daemon.export.test_report import text_of
from tests.daemon.export.test_urdf import robot_of
from tests.daemon.runs import finish
from tests.daemon.snapshots import restore_snapshot

OLD = "c5a1f0d3b2764b1f9a0cb6f7d3a9e812"
"""A calibration of the snapshot of schema 1, whose run's session is not in it."""
LIMITS_MM = (0.0, 100.0)


async def test_a_runs_calibration_is_taken_away(
    service: Service, client: httpx.AsyncClient, tmp_path: Path
) -> None:
    run, _ = await finish(service, await service.runs.start("anna", "after the move"))
    assert run.calibration_id is not None
    exports = f"/calibrations/{run.calibration_id}/exports"
    offered = (await client.get(exports)).json()
    assert [offer["name"] for offer in offered] == [export.name for export in EXPORTS]
    assert {offer["problem"] for offer in offered} == {None}
    files, sizes = {}, {offer["name"]: offer["size"] for offer in offered}
    for offer in offered:
        answer = await client.get(f"{exports}/{offer['name']}")
        assert answer.status_code == 200
        assert answer.headers["content-type"].split(";")[0] == offer["media_type"]
        made = (await client.get(exports.removesuffix("/exports"))).json()["created_at"]
        stamp = made[:19].replace("-", "").replace(":", "").replace("T", "-")
        assert answer.headers["content-disposition"] == f'attachment; filename="{stamp}-{offer["name"]}"'
        assert offer["size"] in (None, len(answer.content)) or offer["name"] == "session.zip"
        files[offer["name"]] = answer.content
    stored = await service.store.calibration(run.calibration_id)
    assert json.loads(files["calibration.json"]) == json.loads(stored.document)
    robot = robot_of(files["rig.urdf"])
    slide = stored.read().joints[0]
    assert robot.robot.name == "small-rig"
    assert robot.joint_map["slide"].limit.upper == pytest.approx(LIMITS_MM[1] * slide.scale)
    for words in (run.owner, run.note, run.id, stored.read().quality.verdict):
        assert words in text_of(files["report.pdf"])
        assert html.escape(words) in files["report.html"].decode()
    assert b"by direction (left)" in files["report.html"]
    assert yaml.safe_load(files["camera_info.yaml"])["image_width"] == 480
    with zipfile.ZipFile(io.BytesIO(files["session.zip"])) as archive:
        assert archive.testzip() is None
        assert sizes["session.zip"] == sum(entry.file_size for entry in archive.infolist())
        archive.extractall(tmp_path / "unpacked")
    folder = tmp_path / "unpacked" / run.id
    again = solve(load_session(folder))
    assert again.model_dump() == load_calibration(folder / "calibration.json").model_dump()


@pytest.fixture
async def old(profile: Profile, tmp_path: Path) -> AsyncIterator[httpx.AsyncClient]:
    """A client of a daemon whose calibrations are those of the snapshot, and their sessions gone."""
    data = tmp_path / "old"
    data.mkdir()
    restore_snapshot(1, data)
    async with running_service(profile, data) as service:
        transport = httpx.ASGITransport(create_app(service))
        base_url = f"http://localhost/api/v1/calibrations/{OLD}"
        async with httpx.AsyncClient(transport=transport, base_url=base_url) as client:
            yield client


async def test_a_calibration_whose_session_is_gone_says_so_and_is_had_otherwise(
    old: httpx.AsyncClient,
) -> None:
    offered = {offer["name"]: offer for offer in (await old.get("/exports")).json()}
    assert "there is no session.json in" in offered["session.zip"]["problem"]
    refused = await old.get("/exports/session.zip")
    assert (refused.status_code, refused.json()["code"]) == (409, "export_unavailable")
    assert refused.json()["detail"] == offered["session.zip"]["problem"]
    urdf = await old.get("/exports/rig.urdf")
    assert robot_of(urdf.content).joint_map["slide"].limit.velocity > 0


async def test_what_there_is_not_is_not_found(client: httpx.AsyncClient, old: httpx.AsyncClient) -> None:
    unknown = await client.get("/calibrations/none/exports")
    assert (unknown.status_code, unknown.json()["code"]) == (404, "unknown_calibration")
    unknown = await old.get("/exports/rig.usd")
    assert (unknown.status_code, unknown.json()["code"]) == (404, "unknown_export")
    assert (
        "there are report.pdf, report.html, calibration.json, session.zip, rig.urdf"
        in unknown.json()["detail"]
    )
    refused = await old.get("/exports/opencv.yaml?camera=left")
    assert (refused.status_code, refused.json()["code"]) == (409, "export_unavailable")
    assert "there is no camera 'left'" in refused.json()["detail"]
