"""Runs and calibrations outlive the daemon."""

import hashlib
import sqlite3
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from daemon.errors import StoreError, UnknownCalibrationError, UnknownRunError
from daemon.store import CalibrationRecord, RunRecord, RunState, Store
from daemon.store.migrations import schema_version

NOW = datetime(2026, 3, 14, 9, 26, 53, 589793, tzinfo=UTC)
RUN = RunRecord(
    id="run-1",
    state=RunState.RUNNING,
    profile_name="small-rig",
    profile="{}",
    session="sessions/run-1",
    owner="anna",
    note="",
    created_at=NOW,
    started_at=NOW,
)


def calibration(name: str) -> CalibrationRecord:
    return CalibrationRecord(name, NOW, "closed_form", True, RUN.id, '{"some": "document"}')


async def test_what_is_stored_is_there_after_a_restart(tmp_path: Path) -> None:
    store = await Store.open(tmp_path)
    await store.add_run(RUN)
    done = await store.change_run(RUN.id, RunState.SUCCEEDED, calibration=calibration("a"))
    await store.close()

    store = await Store.open(tmp_path)
    assert await store.run(RUN.id) == done
    assert done.calibration_id == "a"
    assert done.created_at == NOW
    assert done.ended_at is not None
    assert await store.active_and_earlier() == ["a"]
    digest = hashlib.sha256(b'{"some": "document"}').hexdigest()
    assert await store.calibration("a") == replace(calibration("a"), checksum=digest)
    assert await store.interrupt_unfinished() == []
    await store.close()


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ('{"quality": {"judgement": "good", "verdict": "Good: all of it"}}', ("good", "Good: all of it")),
        ('{"quality": {"rms_px": 0.1}}', (None, None)),
        ('{"quality": {"judgement": "go', (None, None)),
    ],
)
async def test_the_list_says_what_each_calibration_is_worth(
    tmp_path: Path, document: str, said: tuple[str | None, str | None]
) -> None:
    store = await Store.open(tmp_path)
    await store.add_run(RUN)
    kept = replace(calibration("a"), document=document)
    await store.change_run(RUN.id, RunState.SUCCEEDED, calibration=kept)
    entries = await store.calibrations()
    assert [(entry.judgement, entry.verdict) for entry in entries] == [said]
    await store.close()


async def test_one_calibration_is_active(tmp_path: Path) -> None:
    store = await Store.open(tmp_path)
    for name in ("a", "b"):
        await store.add_run(replace(RUN, id=name))
        await store.change_run(name, RunState.SUCCEEDED, calibration=calibration(name))
    assert {entry.id: entry.active for entry in await store.calibrations()} == {"a": False, "b": True}
    await store.activate("a")
    assert {entry.id: entry.active for entry in await store.calibrations()} == {"a": True, "b": False}
    with pytest.raises(UnknownCalibrationError, match="no calibration 'c'"):
        await store.activate("c")
    assert (await store.active_and_earlier())[0] == "a"
    await store.close()


@pytest.mark.parametrize("state", [RunState.RUNNING, RunState.PAUSED])
async def test_a_run_that_an_earlier_daemon_left_is_interrupted(tmp_path: Path, state: RunState) -> None:
    store = await Store.open(tmp_path)
    await store.add_run(replace(RUN, state=state))
    await store.close()
    store = await Store.open(tmp_path)
    (run,) = await store.interrupt_unfinished()
    assert run == await store.run(RUN.id)
    assert run.state is RunState.INTERRUPTED
    assert "resume it" in (run.error or "")
    await store.close()


async def test_a_run_whose_calibration_cannot_be_stored_stays_as_it_was(tmp_path: Path) -> None:
    store = await Store.open(tmp_path)
    await store.add_run(RUN)
    await store.change_run(RUN.id, RunState.RUNNING, calibration=calibration("a"))
    with pytest.raises(StoreError):
        await store.change_run(RUN.id, RunState.SUCCEEDED, calibration=calibration("a"))
    assert (await store.run(RUN.id)).state is RunState.RUNNING
    assert await store.active_and_earlier() == ["a"]
    await store.close()


async def test_an_unknown_run_is_said_to_be_unknown(tmp_path: Path) -> None:
    store = await Store.open(tmp_path)
    with pytest.raises(UnknownRunError, match=r"^there is no run 'nobody'"):
        await store.run("nobody")
    await store.close()


async def test_a_second_daemon_is_kept_out_of_the_folder(tmp_path: Path) -> None:
    store = await Store.open(tmp_path)
    with pytest.raises(StoreError, match="another activecam uses this data folder"):
        await Store.open(tmp_path)
    await store.close()
    await (await Store.open(tmp_path)).close()


async def test_a_database_of_a_newer_schema_is_left_alone(tmp_path: Path) -> None:
    await (await Store.open(tmp_path)).close()
    with sqlite3.connect(tmp_path / "activecam.db") as database:
        assert database.execute("PRAGMA user_version").fetchone() == (schema_version(),)
        assert database.execute("PRAGMA journal_mode").fetchone() == ("wal",)
        database.execute("PRAGMA user_version = 99")
    database.close()
    with pytest.raises(StoreError, match="newer activecam"):
        await Store.open(tmp_path)


async def test_a_file_that_is_no_database_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "activecam.db").write_bytes(b"this is not a database at all" * 100)
    with pytest.raises(
        StoreError, match=r"activecam\.db: the database cannot be used: file is not a database"
    ):
        await Store.open(tmp_path)


async def test_a_folder_that_cannot_be_made_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="the data folder cannot be used"):
        await Store.open(tmp_path / "file" / "data")
