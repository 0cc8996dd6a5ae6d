"""Answers to requests that had an idempotency key, on disk until they expire."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, Self

from sqlalchemy import Connection, Row, delete, insert, select, update

from daemon.store.database import Database
from daemon.store.tables import ANSWERS, fields_of


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

        def work(connection: Connection) -> list[KeptRequest]:
            connection.execute(delete(ANSWERS).where(ANSWERS.c.asked_at < since))
            oldest_first = select(ANSWERS).order_by(ANSWERS.c.asked_at)
            return [_request(row) for row in connection.execute(oldest_first)]

        return await self._database.transact(work)

    async def add(self, request: KeptRequest, since: datetime) -> None:
        """Store a request that is about to be carried out; those asked before `since` are forgotten."""

        def work(connection: Connection) -> None:
            connection.execute(delete(ANSWERS).where(ANSWERS.c.asked_at < since))
            connection.execute(
                insert(ANSWERS)
                .prefix_with("OR REPLACE")
                .values(key=request.key, fingerprint=request.fingerprint, asked_at=request.asked_at)
            )

        await self._database.transact(work)

    async def settle(self, key: str, answer: KeptAnswer) -> None:
        """Store what a request was answered."""

        def work(connection: Connection) -> None:
            connection.execute(update(ANSWERS).where(ANSWERS.c.key == key).values(fields_of(answer)))

        await self._database.transact(work)


def _request(row: Row[Any]) -> KeptRequest:
    if row.status is None or row.media_type is None or row.body is None:
        return KeptRequest(row.key, row.fingerprint, row.asked_at)
    answer = KeptAnswer(row.status, row.media_type, row.body, row.location)
    return KeptRequest(row.key, row.fingerprint, row.asked_at, answer)
