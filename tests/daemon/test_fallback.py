"""An active calibration that cannot be used gives way to the newest before it that can, and it is said."""

import json
import random
import sqlite3
from collections import Counter
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from calib.errors import CalibError
from daemon.api import create_app
from daemon.errors import DaemonError
from daemon.pose import ActiveCalibration
from daemon.profile import Profile
from daemon.service import Service, running_service
from daemon.store import Store
from tests.daemon.snapshots import VERSIONS, restore_snapshot
from tests.daemon.spoiling import spoil

ACTIVE, BEFORE = "c5a1f0d3b2764b1f9a0cb6f7d3a9e812", "1087d24108964e429a2ba048f07a4efa"
"""The two calibrations of the snapshot of schema 1, of the rig of these tests."""
OTHER_JOINTS = """json_replace(document, '$.joints[0].name', 'tilt')"""
DAMAGES = {
    "cut off": "substr(document, 1, 2000)",
    "no text": "CAST(x'7b22c328' AS TEXT)",
    "no object": "'[]'",
    "of a later format": "json_replace(document, '$.format', 'activecam.calibration/9')",
    "of another rig": OTHER_JOINTS,
}
ANOTHER_DIGIT = "replace(document, '0.0010000227', '0.0010000237')"
"""The slide's scale, 1 in a million larger."""


@pytest.fixture
def data(tmp_path: Path) -> Path:
    folder = tmp_path / "data"
    folder.mkdir()
    restore_snapshot(1, folder)
    return folder


def change(data: Path, calibration: str, document: str) -> None:
    """Change a stored document to what the SQL expression `document` says."""
    with closing(sqlite3.connect(data / "activecam.db")) as database:
        database.execute(f"UPDATE calibrations SET document = {document} WHERE id = ?", [calibration])
        database.commit()


async def asked(service: Service, address: str, method: str = "GET") -> Any:
    transport = httpx.ASGITransport(create_app(service))
    async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1/api/v1") as client:
        return (await client.request(method, address)).json()


async def test_an_active_calibration_in_order_is_used_and_nothing_is_said(
    data: Path, profile: Profile
) -> None:
    async with running_service(profile, data) as service:
        assert service.poses.calibration_id == ACTIVE
        assert [entry["problem"] for entry in await asked(service, "/calibrations")] == [None, None]
        assert not [problem for problem in service.problems if "calibration" in problem]


@pytest.mark.parametrize("damage", DAMAGES)
async def test_a_damaged_one_gives_way_to_the_one_before_it(
    data: Path, profile: Profile, caplog: pytest.LogCaptureFixture, damage: str
) -> None:
    change(data, ACTIVE, DAMAGES[damage])
    async with running_service(profile, data) as service:
        assert service.poses.calibration_id == BEFORE
        said = [problem for problem in service.problems if "calibration" in problem]
        (sentence,) = said
        assert f"poses are computed from '{BEFORE}'" in sentence
        assert sentence in caplog.messages
        health = await asked(service, "/health")
        assert (health["status"], sentence in health["problems"]) == ("degraded", True)

        entries = {entry["id"]: entry for entry in await asked(service, "/calibrations")}
        assert {name: entry["active"] for name, entry in entries.items()} == {BEFORE: True, ACTIVE: False}
        assert entries[ACTIVE]["problem"] in sentence
        assert entries[BEFORE]["problem"] is None
        one = await asked(service, f"/calibrations/{ACTIVE}")
        if damage != "of another rig":
            assert one["code"] in {"calibration_damaged", "store_unavailable"}
        assert (await asked(service, "/calibrations/current"))["active"] is True


async def test_a_digit_that_is_another_is_noticed(tmp_path: Path, profile: Profile) -> None:
    data = tmp_path / "data"
    data.mkdir()
    restore_snapshot(VERSIONS[-1], data)
    change(data, ACTIVE, ANOTHER_DIGIT)
    async with running_service(profile, data) as service:
        assert service.poses.calibration_id == BEFORE
        assert (
            f"calibration '{ACTIVE}' is damaged: its document is not what was stored" in service.problems[-1]
        )
        for address, method in (("", "GET"), ("/activate", "POST")):
            refused = await asked(service, f"/calibrations/{ACTIVE}{address}", method)
            assert refused["code"] == "calibration_damaged"
        assert (await asked(service, "/calibrations/current"))["id"] == BEFORE


async def test_a_document_without_a_checksum_is_taken_as_it_is(data: Path, profile: Profile) -> None:
    change(data, ACTIVE, ANOTHER_DIGIT)
    async with running_service(profile, data) as service:
        assert service.poses.calibration_id == ACTIVE


async def test_it_is_said_until_a_person_has_chosen(data: Path, profile: Profile) -> None:
    change(data, ACTIVE, OTHER_JOINTS)
    for _ in range(2):
        async with running_service(profile, data) as service:
            assert service.fallback is not None
    async with running_service(profile, data) as service:
        assert (await asked(service, f"/calibrations/{BEFORE}/activate", "POST"))["problem"] is None
        assert service.fallback is None
    async with running_service(profile, data) as service:
        assert service.poses.calibration_id == BEFORE
        assert service.fallback is None


async def test_a_rig_whose_calibrations_are_all_damaged_starts_without_a_pose(
    data: Path, profile: Profile
) -> None:
    for calibration in (ACTIVE, BEFORE):
        change(data, calibration, DAMAGES["cut off"])
    async with running_service(profile, data) as service:
        assert service.poses.calibration_id is None
        assert "none before it can be used, so that there is no pose" in service.problems[-1]
        assert all(entry["problem"] for entry in await asked(service, "/calibrations"))
        assert (await asked(service, "/pose"))["code"] == "not_calibrated"


async def test_one_made_later_is_not_taken(data: Path, profile: Profile) -> None:
    """Whoever went back to an earlier calibration had a reason to leave the later one."""
    store = await Store.open(data)
    await store.activate(BEFORE)
    await store.close()
    change(data, BEFORE, DAMAGES["cut off"])
    async with running_service(profile, data) as service:
        assert service.poses.calibration_id is None


@pytest.mark.filterwarnings("ignore:overflow encountered:RuntimeWarning")
async def test_no_damage_is_an_error_in_the_program(data: Path) -> None:
    store = await Store.open(data)
    record = await store.calibration(ACTIVE)
    await store.close()
    rng = random.Random(6)
    outcomes = Counter[str]()
    for _ in range(100):
        document = json.loads(record.document)
        spoil(document, rng)
        try:
            read = replace(record, document=json.dumps(document)).read()
            prepared = ActiveCalibration.of(record.id, read, ["slide", "pan"])
            prepared.poses(np.array([[20.0, 1.0]]), None)
        except (CalibError, DaemonError):
            outcomes["refused"] += 1
        else:
            outcomes["harmless"] += 1
    assert min(outcomes["refused"], outcomes["harmless"]) > 20
