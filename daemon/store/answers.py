"""Answers to requests that had an idempotency key, on disk until they expire."""

import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Self

from daemon.store.database import Database
from daemon.store.tables import text_of, time_of


@dataclass(frozen=True, slots=True)
class KeptAnswer:
    """An answer as it is given again."""

    status: int
    media_type: str
    body: bytes
    location: str | None = None


@dataclass(frozen=True, slots=True)
class KeptRequest:
    """A request by its key; `fingerprint` tells it from others, `answer` is None until it is answered."""

    key: str
    fingerprint: str
    asked_at: datetime
    answer: KeptAnswer | None = None

    def answered(self, answer: KeptAnswer) -> Self:
        """Return it with its answer."""
        return replace(self, answer=answer)


class StoredAnswers:
    """The table of them. Every method raises StoreError when the disk fails."""

    def __init__(self, database: Database) -> None:
        self._database = database

    async def read(self, since: datetime) -> Sequence[KeptRequest]:
        """Return the requests asked since then, the oldest first; those before are forgotten."""

        def work(connection: sqlite3.Connection) -> list[KeptRequest]:
            _forget(connection, since)
            return [_request(row) for row in connection.execute("SELECT * FROM answers ORDER BY asked_at")]

        return await self._database.transact(work)

    async def add(self, request: KeptRequest, since: datetime) -> None:
        """Store a request that is about to be carried out; those asked before `since` are forgotten."""

        def work(connection: sqlite3.Connection) -> None:
            _forget(connection, since)
            connection.execute(
                "REPLACE INTO answers (key, fingerprint, asked_at) VALUES (?, ?, ?)",
                (request.key, request.fingerprint, text_of(request.asked_at)),
            )

        await self._database.transact(work)

    async def settle(self, key: str, answer: KeptAnswer) -> None:
        """Store what a request was answered."""

        def work(connection: sqlite3.Connection) -> None:
            connection.execute(
                "UPDATE answers SET status = ?, media_type = ?, body = ?, location = ? WHERE key = ?",
                (answer.status, answer.media_type, answer.body, answer.location, key),
            )

        await self._database.transact(work)


def _forget(connection: sqlite3.Connection, before: datetime) -> None:
    connection.execute("DELETE FROM answers WHERE asked_at < ?", (text_of(before),))


def _request(row: sqlite3.Row) -> KeptRequest:
    answer = None
    if row["status"] is not None:
        answer = KeptAnswer(row["status"], row["media_type"], row["body"], row["location"])
    return KeptRequest(row["key"], row["fingerprint"], time_of(row["asked_at"]), answer)
