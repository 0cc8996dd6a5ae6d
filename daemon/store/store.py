"""Runs and calibrations, kept for good under the data folder; keys and the audit log beside them."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from sqlalchemy import ColumnElement, Connection, Row, case, func, insert, select, update

from daemon.errors import UnknownCalibrationError, UnknownRunError
from daemon.store.answers import StoredAnswers
from daemon.store.audit import StoredAudit
from daemon.store.database import Database
from daemon.store.keys import StoredKeys
from daemon.store.records import (
    CalibrationRecord,
    CalibrationSummary,
    RunRecord,
    RunState,
    checksum_of,
)
from daemon.store.tables import CALIBRATIONS, RUNS, fields_of


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

    @property
    def folder(self) -> Path:
        """The data folder."""
        return self._database.folder

    async def close(self) -> None:
        """Let the database go."""
        await self._database.close()

    @property
    def errors(self) -> int:
        """How often the database could not be used."""
        return self._database.errors

    async def check_writable(self) -> None:
        """Write, though nothing new, and have it on disk; raises StoreError where that cannot be done."""

        def work(connection: Connection) -> None:
            version = connection.exec_driver_sql("PRAGMA user_version").scalar_one()
            connection.exec_driver_sql(f"PRAGMA user_version = {version}")

        await self._database.transact(work)

    def session_folder(self, run: RunRecord) -> Path:
        """Return where the session of `run` is."""
        return self._database.folder / run.session

    async def interrupt_unfinished(self) -> list[RunRecord]:
        """Mark the runs that an earlier daemon left unfinished, and return them."""
        now = datetime.now(UTC)

        interrupt = (
            update(RUNS)
            .where(RUNS.c.state.in_([RunState.RUNNING, RunState.PAUSED]))
            .values(
                state=RunState.INTERRUPTED,
                ended_at=now,
                error="the daemon ended while this run was under way: "
                "resume it, or solve the views taken so far as they are",
            )
            .returning(*RUNS.c)
        )
        return await self._database.transact(
            lambda connection: [_run(row) for row in connection.execute(interrupt)]
        )

    async def add_run(self, run: RunRecord) -> None:
        """Store a new run."""
        await self._database.transact(
            lambda connection: connection.execute(insert(RUNS).values(fields_of(run)))
        )

    async def change_run(
        self,
        run_id: str,
        state: RunState,
        error: str | None = None,
        *,
        calibration: CalibrationRecord | None = None,
    ) -> RunRecord:
        """Move a run to `state`; a `calibration` is stored, and activated if it says so, in the same transaction."""
        changes = {
            "state": state,
            "error": error,
            "ended_at": datetime.now(UTC) if state.over else None,
        }
        if calibration is not None:
            changes["calibration_id"] = calibration.id

        def work(connection: Connection) -> RunRecord:
            if calibration is not None:
                _add(connection, calibration)
            connection.execute(update(RUNS).where(RUNS.c.id == run_id).values(changes))
            return _run_of(connection, run_id)

        return await self._database.transact(work)

    async def run(self, run_id: str) -> RunRecord:
        """Return one run; raises UnknownRunError."""
        return await self._database.transact(lambda connection: _run_of(connection, run_id))

    async def runs(self) -> Sequence[RunRecord]:
        """Return all runs, the newest first."""
        newest_first = select(RUNS).order_by(RUNS.c.created_at.desc(), RUNS.c.id.desc())
        return await self._database.transact(
            lambda connection: [_run(row) for row in connection.execute(newest_first)]
        )

    async def calibrations(self) -> Sequence[CalibrationSummary]:
        """Return all calibrations without their documents, the newest first."""
        columns = select(
            CALIBRATIONS.c.id,
            CALIBRATIONS.c.created_at,
            CALIBRATIONS.c.method,
            CALIBRATIONS.c.active,
            CALIBRATIONS.c.run_id,
            _of_document("$.quality.judgement"),
            _of_document("$.quality.verdict"),
        ).order_by(CALIBRATIONS.c.created_at.desc(), CALIBRATIONS.c.id.desc())
        return await self._database.transact(
            lambda connection: [CalibrationSummary(*row) for row in connection.execute(columns)]
        )

    async def calibration(self, calibration_id: str) -> CalibrationRecord:
        """Return one calibration; raises UnknownCalibrationError."""
        return await self._database.transact(lambda connection: _calibration_of(connection, calibration_id))

    async def active_and_earlier(self) -> Sequence[str]:
        """Return the ids of the active calibration and of those made before it, the newest first; or none at all."""
        made = select(CALIBRATIONS.c.created_at).where(CALIBRATIONS.c.active).scalar_subquery()
        ids = (
            select(CALIBRATIONS.c.id)
            .where(CALIBRATIONS.c.created_at <= made)
            .order_by(
                CALIBRATIONS.c.active.desc(), CALIBRATIONS.c.created_at.desc(), CALIBRATIONS.c.id.desc()
            )
        )
        return await self._database.transact(lambda connection: connection.scalars(ids).all())

    async def activate(self, calibration_id: str) -> CalibrationRecord:
        """Make one calibration the active one; raises UnknownCalibrationError."""

        def work(connection: Connection) -> CalibrationRecord:
            _deactivate_all(connection)
            activate = update(CALIBRATIONS).where(CALIBRATIONS.c.id == calibration_id).values(active=True)
            connection.execute(activate)
            return _calibration_of(connection, calibration_id)

        return await self._database.transact(work)


def _of_document(path: str) -> ColumnElement[str | None]:
    """Select a text in the stored document; null where it is not there, or the document is damaged."""
    document = CALIBRATIONS.c.document
    return case((func.json_valid(document) == 1, func.json_extract(document, path)), else_=None)


def _add(connection: Connection, calibration: CalibrationRecord) -> None:
    if calibration.active:
        _deactivate_all(connection)
    fields = fields_of(calibration) | {"checksum": checksum_of(calibration.document)}
    connection.execute(insert(CALIBRATIONS).values(fields))


def _deactivate_all(connection: Connection) -> None:
    connection.execute(update(CALIBRATIONS).where(CALIBRATIONS.c.active).values(active=False))


def _run_of(connection: Connection, run_id: str) -> RunRecord:
    row = connection.execute(select(RUNS).where(RUNS.c.id == run_id)).one_or_none()
    if row is None:
        raise UnknownRunError(f"there is no run '{run_id}': GET /api/v1/runs lists those that there are")
    return _run(row)


def _calibration_of(connection: Connection, calibration_id: str) -> CalibrationRecord:
    found = select(CALIBRATIONS).where(CALIBRATIONS.c.id == calibration_id)
    row = connection.execute(found).one_or_none()
    if row is None:
        raise UnknownCalibrationError(
            f"there is no calibration '{calibration_id}': GET /api/v1/calibrations lists those that there are"
        )
    return CalibrationRecord(**row._asdict())


def _run(row: Row[Any]) -> RunRecord:
    return RunRecord(**row._asdict() | {"state": RunState(row.state)})
