"""Runs and calibrations, kept for good under the data folder; keys and the audit log beside them."""

import sqlite3
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, Self

from daemon.errors import UnknownCalibrationError, UnknownRunError
from daemon.store.answers import StoredAnswers
from daemon.store.audit import StoredAudit
from daemon.store.database import Database
from daemon.store.keys import StoredKeys
from daemon.store.records import CalibrationRecord, CalibrationSummary, RunRecord, RunState
from daemon.store.tables import insert, maybe_time_of, text_of, time_of

SUMMARIES: Final = """
SELECT id, created_at, method, active, run_id,
    CASE WHEN json_valid(document) THEN json_extract(document, '$.quality.judgement') END AS judgement,
    CASE WHEN json_valid(document) THEN json_extract(document, '$.quality.verdict') END AS verdict
FROM calibrations ORDER BY created_at DESC, id DESC
"""
"""All calibrations without their documents, which may be damaged, the newest first."""


class Store:
    """The database and the session folders beside it. Every method raises StoreError when the disk fails."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self.answers = StoredAnswers(database)
        self.keys = StoredKeys(database)
        self.audit = StoredAudit(database)

    @classmethod
    async def open(cls, folder: Path, *, beside_daemon: bool = False) -> Self:
        """Open or create what is stored in `folder`; see `Database.open`."""
        return cls(await Database.open(folder, beside_daemon=beside_daemon))

    async def close(self) -> None:
        """Let the database go."""
        await self._database.close()

    @property
    def errors(self) -> int:
        """How often the database could not be used."""
        return self._database.errors

    async def check_writable(self) -> None:
        """Write, though nothing new, and have it on disk; raises StoreError where that cannot be done."""

        def work(connection: sqlite3.Connection) -> None:
            (version,) = connection.execute("PRAGMA user_version").fetchone()
            connection.execute(f"PRAGMA user_version = {version}")

        await self._database.transact(work)

    def session_folder(self, run: RunRecord) -> Path:
        """Return where the session of `run` is."""
        return self._database.folder / run.session

    async def interrupt_unfinished(self) -> list[RunRecord]:
        """Mark the runs that an earlier daemon left unfinished, and return them."""
        change = (
            "UPDATE runs SET state = ?, ended_at = ?, error = ? WHERE state IN (?, ?) RETURNING *",
            (
                RunState.INTERRUPTED,
                text_of(datetime.now(UTC)),
                "the daemon ended while this run was under way: "
                "resume it, or solve the views taken so far as they are",
                RunState.RUNNING,
                RunState.PAUSED,
            ),
        )
        return await self._database.transact(
            lambda connection: [_run(row) for row in connection.execute(*change)]
        )

    async def add_run(self, run: RunRecord) -> None:
        """Store a new run."""
        await self._database.transact(lambda connection: insert(connection, "runs", run))

    async def change_run(
        self,
        run_id: str,
        state: RunState,
        error: str | None = None,
        *,
        calibration: CalibrationRecord | None = None,
    ) -> RunRecord:
        """Move a run to `state`; a `calibration` is stored, and activated if it says so, in the same transaction."""
        ended_at = text_of(datetime.now(UTC)) if state.over else None

        def work(connection: sqlite3.Connection) -> RunRecord:
            found = _run_of(connection, run_id).calibration_id
            if calibration is not None:
                _add(connection, calibration)
                found = calibration.id
            connection.execute(
                "UPDATE runs SET state = ?, error = ?, ended_at = ?, calibration_id = ? WHERE id = ?",
                (state, error, ended_at, found, run_id),
            )
            return _run_of(connection, run_id)

        return await self._database.transact(work)

    async def run(self, run_id: str) -> RunRecord:
        """Return one run; raises UnknownRunError."""
        return await self._database.transact(lambda connection: _run_of(connection, run_id))

    async def runs(self) -> Sequence[RunRecord]:
        """Return all runs, the newest first."""
        newest_first = "SELECT * FROM runs ORDER BY created_at DESC, id DESC"
        return await self._database.transact(
            lambda connection: [_run(row) for row in connection.execute(newest_first)]
        )

    async def calibrations(self) -> Sequence[CalibrationSummary]:
        """Return all calibrations without their documents, the newest first."""
        return await self._database.transact(
            lambda connection: [_summary(row) for row in connection.execute(SUMMARIES)]
        )

    async def calibration(self, calibration_id: str) -> CalibrationRecord:
        """Return one calibration; raises UnknownCalibrationError."""
        return await self._database.transact(lambda connection: _calibration_of(connection, calibration_id))

    async def active_and_earlier(self) -> Sequence[str]:
        """Return the ids of the active calibration and of those made before it, the newest first; or none at all."""
        ids = (
            "SELECT id FROM calibrations WHERE created_at <= (SELECT created_at FROM calibrations WHERE active) "
            "ORDER BY active DESC, created_at DESC, id DESC"
        )
        return await self._database.transact(
            lambda connection: [row["id"] for row in connection.execute(ids)]
        )

    async def activate(self, calibration_id: str) -> CalibrationRecord:
        """Make one calibration the active one; raises UnknownCalibrationError."""

        def work(connection: sqlite3.Connection) -> CalibrationRecord:
            _deactivate_all(connection)
            connection.execute("UPDATE calibrations SET active = TRUE WHERE id = ?", (calibration_id,))
            return _calibration_of(connection, calibration_id)

        return await self._database.transact(work)


def _add(connection: sqlite3.Connection, calibration: CalibrationRecord) -> None:
    if calibration.active:
        _deactivate_all(connection)
    insert(connection, "calibrations", calibration)


def _deactivate_all(connection: sqlite3.Connection) -> None:
    connection.execute("UPDATE calibrations SET active = FALSE WHERE active")


def _run_of(connection: sqlite3.Connection, run_id: str) -> RunRecord:
    row = connection.execute("SELECT * FROM runs WHERE id = ?", (run_id,)).fetchone()
    if row is None:
        raise UnknownRunError(f"there is no run '{run_id}': GET /api/v1/runs lists those that there are")
    return _run(row)


def _calibration_of(connection: sqlite3.Connection, calibration_id: str) -> CalibrationRecord:
    row = connection.execute("SELECT * FROM calibrations WHERE id = ?", (calibration_id,)).fetchone()
    if row is None:
        raise UnknownCalibrationError(
            f"there is no calibration '{calibration_id}': GET /api/v1/calibrations lists those that there are"
        )
    return CalibrationRecord(
        **dict(row) | {"created_at": time_of(row["created_at"]), "active": bool(row["active"])}
    )


def _run(row: sqlite3.Row) -> RunRecord:
    return RunRecord(
        **dict(row)
        | {
            "state": RunState(row["state"]),
            "created_at": time_of(row["created_at"]),
            "started_at": maybe_time_of(row["started_at"]),
            "ended_at": maybe_time_of(row["ended_at"]),
        }
    )


def _summary(row: sqlite3.Row) -> CalibrationSummary:
    return CalibrationSummary(
        **dict(row) | {"created_at": time_of(row["created_at"]), "active": bool(row["active"])}
    )
