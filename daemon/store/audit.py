"""The audit log: the latest entries of what was done. Every method raises StoreError when the disk fails."""

from collections.abc import Collection, Sequence
from typing import Final

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from daemon.access.entries import AuditEntry
from daemon.access.roles import Role
from daemon.store.database import Database
from daemon.store.tables import AuditRow

KEPT: Final = 100_000
"""Entries, some 20 MB; the oldest make room for new ones."""


class StoredAudit:
    """The audit log in a database."""

    def __init__(self, database: Database, kept: int = KEPT) -> None:
        self._database = database
        self._kept = kept

    async def write(self, entries: Collection[AuditEntry]) -> None:
        """Store new entries, which get their ids, and what has changed in others; drop the oldest."""

        def work(session: Session) -> None:
            rows = [(entry, session.merge(_row(entry))) for entry in entries]
            session.flush()
            newest = select(func.max(AuditRow.id)).scalar_subquery()
            session.execute(delete(AuditRow).where(AuditRow.id <= newest - self._kept))
            numbers.extend((entry, row.id) for entry, row in rows)

        numbers: list[tuple[AuditEntry, int]] = []
        if entries:
            await self._database.transact(work)
        for entry, number in numbers:
            entry.id = number

    async def read(self, before: int | None, limit: int) -> Sequence[AuditEntry]:
        """Return the newest `limit` entries, of those with ids below `before`, the newest first."""
        newest = select(AuditRow).order_by(AuditRow.id.desc()).limit(limit)
        if before is not None:
            newest = newest.where(AuditRow.id < before)
        return await self._database.transact(lambda session: [_entry(row) for row in session.scalars(newest)])


def _row(entry: AuditEntry) -> AuditRow:
    return AuditRow(**{name: getattr(entry, name) for name in AuditEntry.__dataclass_fields__})


def _entry(row: AuditRow) -> AuditEntry:
    fields = {name: getattr(row, name) for name in AuditEntry.__dataclass_fields__}
    return AuditEntry(**fields | {"role": Role(row.role)})
