"""Runs and calibrations, kept for good under the data folder; keys and the audit log beside them."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Self

from sqlalchemy import ColumnElement, case, func, select, update
from sqlalchemy.orm import Session

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
from daemon.store.tables import CalibrationRow, RunRow


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

        def work(session: Session) -> None:
            connection = session.connection()
            version = connection.exec_driver_sql("PRAGMA user_version").scalar_one()
            connection.exec_driver_sql(f"PRAGMA user_version = {version}")

        await self._database.transact(work)

    def session_folder(self, run: RunRecord) -> Path:
        """Return where the session of `run` is."""
        return self._database.folder / run.session

    async def interrupt_unfinished(self) -> list[RunRecord]:
        """Mark the runs that an earlier daemon left unfinished, and return them."""
        now = datetime.now(UTC)

        def work(session: Session) -> list[RunRecord]:
            rows = session.scalars(select(RunRow).where(RunRow.state.in_(["running", "paused"]))).all()
            for row in rows:
                row.state, row.ended_at = RunState.INTERRUPTED, now
                row.error = (
                    "the daemon ended while this run was under way: "
                    "resume it, or solve the views taken so far as they are"
                )
            return [_run(row) for row in rows]

        return await self._database.transact(work)

    async def add_run(self, run: RunRecord) -> None:
        """Store a new run."""

        def work(session: Session) -> None:
            fields = {name: getattr(run, name) for name in RunRecord.__dataclass_fields__}
            session.add(RunRow(**fields | {"state": run.state.value}))

        await self._database.transact(work)

    async def change_run(
        self,
        run_id: str,
        state: RunState,
        error: str | None = None,
        *,
        calibration: CalibrationRecord | None = None,
    ) -> RunRecord:
        """Move a run to `state`; a `calibration` is stored, and activated if it says so, in the same transaction."""

        def work(session: Session) -> RunRecord:
            row = _find_run(session, run_id)
            row.state, row.error = state.value, error
            row.ended_at = datetime.now(UTC) if state.over else None
            if calibration is not None:
                _add(session, calibration)
                row.calibration_id = calibration.id
            return _run(row)

        return await self._database.transact(work)

    async def run(self, run_id: str) -> RunRecord:
        """Return one run; raises UnknownRunError."""
        return await self._database.transact(lambda session: _run(_find_run(session, run_id)))

    async def runs(self) -> Sequence[RunRecord]:
        """Return all runs, the newest first."""
        newest_first = select(RunRow).order_by(RunRow.created_at.desc(), RunRow.id.desc())
        return await self._database.transact(
            lambda session: [_run(row) for row in session.scalars(newest_first)]
        )

    async def calibrations(self) -> Sequence[CalibrationSummary]:
        """Return all calibrations without their documents, the newest first."""
        columns = select(
            CalibrationRow.id,
            CalibrationRow.created_at,
            CalibrationRow.method,
            CalibrationRow.active,
            CalibrationRow.run_id,
            _of_document("$.quality.judgement"),
            _of_document("$.quality.verdict"),
        ).order_by(CalibrationRow.created_at.desc(), CalibrationRow.id.desc())
        return await self._database.transact(
            lambda session: [CalibrationSummary(*row) for row in session.execute(columns)]
        )

    async def calibration(self, calibration_id: str) -> CalibrationRecord:
        """Return one calibration; raises UnknownCalibrationError."""
        return await self._database.transact(
            lambda session: _calibration(_find_calibration(session, calibration_id))
        )

    async def active_and_earlier(self) -> Sequence[str]:
        """Return the ids of the active calibration and of those made before it, the newest first; or none at all."""
        made = select(CalibrationRow.created_at).where(CalibrationRow.active).scalar_subquery()
        ids = (
            select(CalibrationRow.id)
            .where(CalibrationRow.created_at <= made)
            .order_by(
                CalibrationRow.active.desc(), CalibrationRow.created_at.desc(), CalibrationRow.id.desc()
            )
        )
        return await self._database.transact(lambda session: session.scalars(ids).all())

    async def activate(self, calibration_id: str) -> CalibrationRecord:
        """Make one calibration the active one; raises UnknownCalibrationError."""

        def work(session: Session) -> CalibrationRecord:
            row = _find_calibration(session, calibration_id)
            _deactivate_all(session)
            row.active = True
            session.flush()
            return _calibration(row)

        return await self._database.transact(work)


def _of_document(path: str) -> ColumnElement[str | None]:
    """Select a text in the stored document; null where it is not there, or the document is damaged."""
    document = CalibrationRow.document
    return case((func.json_valid(document) == 1, func.json_extract(document, path)), else_=None)


def _add(session: Session, calibration: CalibrationRecord) -> None:
    if calibration.active:
        _deactivate_all(session)
    fields = {name: getattr(calibration, name) for name in CalibrationRecord.__dataclass_fields__}
    session.add(CalibrationRow(**fields | {"checksum": checksum_of(calibration.document)}))
    session.flush()  # before the run that refers to it


def _deactivate_all(session: Session) -> None:
    session.execute(update(CalibrationRow).where(CalibrationRow.active).values(active=False))


def _find_run(session: Session, run_id: str) -> RunRow:
    row = session.get(RunRow, run_id)
    if row is None:
        raise UnknownRunError(f"there is no run '{run_id}': GET /api/v1/runs lists those that there are")
    return row


def _find_calibration(session: Session, calibration_id: str) -> CalibrationRow:
    row = session.get(CalibrationRow, calibration_id)
    if row is None:
        raise UnknownCalibrationError(
            f"there is no calibration '{calibration_id}': GET /api/v1/calibrations lists those that there are"
        )
    return row


def _run(row: RunRow) -> RunRecord:
    return RunRecord(
        row.id,
        RunState(row.state),
        row.profile_name,
        row.profile,
        row.session,
        row.owner,
        row.note,
        row.created_at,
        row.started_at,
        row.ended_at,
        row.error,
        row.calibration_id,
    )


def _calibration(row: CalibrationRow) -> CalibrationRecord:
    return CalibrationRecord(
        row.id,
        row.created_at,
        row.method,
        row.active,
        row.run_id,
        row.document,
        row.verification,
        row.checksum,
    )
