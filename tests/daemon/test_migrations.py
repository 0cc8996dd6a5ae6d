"""What an older activecam left is there in today's."""

import logging
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Connection

from calib import Calibration
from daemon.errors import StoreError
from daemon.store import RunState, Store, migrations
from tests.daemon.snapshots import VERSIONS, dump, restore_snapshot


def structure(folder: Path) -> dict[str, Any]:
    """Return each table's columns, indices and references, however they came to be."""
    with closing(sqlite3.connect(folder / "activecam.db")) as database:
        tables = [name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        return {
            table: (
                {row[1:] for row in database.execute(f"PRAGMA table_info({table})")},
                {
                    (*row[2:], tuple(database.execute(f"PRAGMA index_info({row[1]})")))
                    for row in database.execute(f"PRAGMA index_list({table})")
                },
                {row[2:] for row in database.execute(f"PRAGMA foreign_key_list({table})")},
            )
            for table in tables
        }


async def open_and_close(folder: Path) -> None:
    await (await Store.open(folder)).close()


@pytest.mark.parametrize("version", VERSIONS)
async def test_what_an_older_version_left_is_there(tmp_path: Path, version: int) -> None:
    restore_snapshot(version, tmp_path)
    store = await Store.open(tmp_path)
    runs = {run.id.rsplit("-", 1)[1]: run for run in await store.runs()}
    assert {name: run.state for name, run in runs.items()} == {
        "2c6f95": RunState.RUNNING,
        "d4410b": RunState.INTERRUPTED,
        "17be42": RunState.CANCELLED,
        "90ac3e": RunState.FAILED,
        "b02d77": RunState.SUCCEEDED,
        "5f3a1c": RunState.SUCCEEDED,
    }
    assert runs["90ac3e"].note == "it's “quoted”; and has\ntwo lines"
    assert runs["90ac3e"].error == "axis 'pan' is in fault: the controller is in alarm"
    assert runs["b02d77"].session == "sessions/20260314-102653-b02d77"
    assert [run.id for run in await store.interrupt_unfinished()] == [runs["2c6f95"].id]

    active = await store.calibration((await store.active_and_earlier())[0])
    assert (active.id, active.run_id) == (runs["b02d77"].calibration_id, runs["b02d77"].id)
    assert active.verification is not None
    calibrations = [await store.calibration(entry.id) for entry in await store.calibrations()]
    assert [calibration.active for calibration in calibrations] == [True, False]
    for calibration in calibrations:
        document = Calibration.model_validate_json(calibration.document)
        assert [joint.name for joint in document.joints] == ["slide", "pan"]
    await store.close()


@pytest.mark.parametrize("version", VERSIONS)
async def test_an_older_database_comes_to_be_as_a_new_one(tmp_path: Path, version: int) -> None:
    for name in ("old", "new"):
        (tmp_path / name).mkdir()
    restore_snapshot(version, tmp_path / "old")
    await open_and_close(tmp_path / "old")
    await open_and_close(tmp_path / "new")
    assert structure(tmp_path / "old") == structure(tmp_path / "new")


def test_every_schema_is_kept_for_these_tests() -> None:
    """A change of the tables without a migration, or a migration without its snapshot, would go unnoticed."""
    assert list(range(1, migrations.schema_version() + 1)) == VERSIONS


def add_a_place(connection: Connection) -> None:
    connection.exec_driver_sql("ALTER TABLE runs ADD COLUMN place TEXT")
    connection.exec_driver_sql("UPDATE runs SET place = 'the cellar'")


def break_off(connection: Connection) -> None:
    add_a_place(connection)
    connection.exec_driver_sql("CREATE TABLE visitors (id INTEGER PRIMARY KEY)")
    connection.exec_driver_sql("UPDATE there_is_no_such_table SET place = 1")


def lose_a_calibration(connection: Connection) -> None:
    connection.exec_driver_sql("DELETE FROM calibrations")


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """A folder with a database of the newest schema that there is a snapshot of."""
    restore_snapshot(VERSIONS[-1], tmp_path)
    return tmp_path


async def test_a_migration_keeps_a_copy_of_how_it_was(
    old: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    before = dump(old)
    monkeypatch.setattr(migrations, "MIGRATIONS", (*migrations.MIGRATIONS, add_a_place))
    with caplog.at_level(logging.WARNING):
        await open_and_close(old)
    with closing(sqlite3.connect(old / "activecam.db")) as database:
        assert database.execute("SELECT DISTINCT place FROM runs").fetchall() == [("the cellar",)]
        assert database.execute("PRAGMA user_version").fetchone() == (VERSIONS[-1] + 1,)
    copy = old / f"activecam.schema-{VERSIONS[-1]}.db"
    assert f"{copy} is how it was" in caplog.text
    copy.rename(old / "activecam.db")
    assert dump(old) == before


@pytest.mark.parametrize("broken", [break_off, lose_a_calibration])
async def test_a_migration_that_fails_leaves_the_file_as_it_was(
    old: Path, monkeypatch: pytest.MonkeyPatch, broken: migrations.Migration
) -> None:
    before = dump(old)
    known = migrations.MIGRATIONS
    monkeypatch.setattr(migrations, "MIGRATIONS", (*known, add_a_place, broken))
    with pytest.raises(StoreError, match=r"it is as it was, so go on with the activecam that wrote it"):
        await open_and_close(old)
    assert dump(old) == before
    monkeypatch.setattr(migrations, "MIGRATIONS", (*known, add_a_place))
    await open_and_close(old)


async def test_nothing_is_migrated_where_no_copy_can_be_made(
    old: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = dump(old)
    (old / f"activecam.schema-{VERSIONS[-1]}.db").mkdir()
    monkeypatch.setattr(migrations, "MIGRATIONS", (*migrations.MIGRATIONS, add_a_place))
    with pytest.raises(StoreError, match="the database could not be copied to"):
        await open_and_close(old)
    assert dump(old) == before
