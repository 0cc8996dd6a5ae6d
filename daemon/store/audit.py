"""The audit log: the latest entries of what was done. Every method raises StoreError when the disk fails."""

from collections.abc import Collection, Sequence
from typing import Any, Final

from sqlalchemy import Connection, Row, delete, func, insert, select

from daemon.access.entries import AuditEntry
from daemon.access.roles import Role
from daemon.store.database import Database
from daemon.store.tables import AUDIT, fields_of

KEPT: Final = 100_000
"""Entries, some 20 MB; the oldest make room for new ones."""


class StoredAudit:
    """The audit log in a database."""

    def __init__(self, database: Database, kept: int = KEPT) -> None:
        self._database = database
        self._kept = kept

    async def write(self, entries: Collection[AuditEntry]) -> None:
        """Store new entries, which get their ids, and what has changed in others; drop the oldest."""

        def work(connection: Connection) -> list[int]:
            put = insert(AUDIT).prefix_with("OR REPLACE")
            numbers = [connection.execute(put.values(fields_of(entry))).lastrowid for entry in entries]
            newest = select(func.max(AUDIT.c.id)).scalar_subquery()
            connection.execute(delete(AUDIT).where(AUDIT.c.id <= newest - self._kept))
            return numbers

        if entries:
            numbers = await self._database.transact(work)
            for entry, number in zip(entries, numbers, strict=True):
                entry.id = number

    async def read(self, before: int | None, limit: int) -> Sequence[AuditEntry]:
        """Return the newest `limit` entries, of those with ids below `before`, the newest first."""
        newest = select(AUDIT).order_by(AUDIT.c.id.desc()).limit(limit)
        if before is not None:
            newest = newest.where(AUDIT.c.id < before)
        return await self._database.transact(
            lambda connection: [_entry(row) for row in connection.execute(newest)]
        )


def _entry(row: Row[Any]) -> AuditEntry:
    return AuditEntry(**row._asdict() | {"role": Role(row.role)})
