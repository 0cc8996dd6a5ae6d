"""The audit log: the latest entries of what was done. Every method raises StoreError when the disk fails."""

import sqlite3
from collections.abc import Collection, Sequence
from typing import Final

from daemon.access.entries import AuditEntry
from daemon.access.roles import Role
from daemon.store.database import Database
from daemon.store.tables import insert, time_of

KEPT: Final = 100_000
"""Entries, some 20 MB; the oldest make room for new ones."""


class StoredAudit:
    """The audit log in a database."""

    def __init__(self, database: Database, kept: int = KEPT) -> None:
        self._database = database
        self._kept = kept

    async def write(self, entries: Collection[AuditEntry]) -> None:
        """Store new entries, which get their ids, and what has changed in others; drop the oldest."""

        def work(connection: sqlite3.Connection) -> list[int | None]:
            numbers = [insert(connection, "audit", entry, replace=True) for entry in entries]
            connection.execute("DELETE FROM audit WHERE id <= (SELECT max(id) FROM audit) - ?", (self._kept,))
            return numbers

        if entries:
            numbers = await self._database.transact(work)
            for entry, number in zip(entries, numbers, strict=True):
                entry.id = number

    async def read(self, before: int | None, limit: int) -> Sequence[AuditEntry]:
        """Return the newest `limit` entries, of those with ids below `before`, the newest first."""
        newest = "SELECT * FROM audit WHERE ? IS NULL OR id < ? ORDER BY id DESC LIMIT ?"
        return await self._database.transact(
            lambda connection: [_entry(row) for row in connection.execute(newest, (before, before, limit))]
        )


def _entry(row: sqlite3.Row) -> AuditEntry:
    return AuditEntry(**dict(row) | {"time": time_of(row["time"]), "role": Role(row["role"])})
