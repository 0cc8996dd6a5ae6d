"""Answers to requests that had an idempotency key, on disk until they expire."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Self

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from daemon.store.database import Database
from daemon.store.tables import AnswerRow


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

        def work(session: Session) -> list[KeptRequest]:
            session.execute(delete(AnswerRow).where(AnswerRow.asked_at < since))
            return [_request(row) for row in session.scalars(select(AnswerRow).order_by(AnswerRow.asked_at))]

        return await self._database.transact(work)

    async def add(self, request: KeptRequest, since: datetime) -> None:
        """Store a request that is about to be carried out; those asked before `since` are forgotten."""

        def work(session: Session) -> None:
            session.execute(delete(AnswerRow).where(AnswerRow.asked_at < since))
            session.merge(
                AnswerRow(
                    key=request.key,
                    fingerprint=request.fingerprint,
                    asked_at=request.asked_at,
                    status=None,
                    media_type=None,
                    body=None,
                    location=None,
                )
            )

        await self._database.transact(work)

    async def settle(self, key: str, answer: KeptAnswer) -> None:
        """Store what a request was answered."""

        def work(session: Session) -> None:
            row = session.get(AnswerRow, key)
            if row is not None:
                row.status, row.media_type = answer.status, answer.media_type
                row.body, row.location = answer.body, answer.location

        await self._database.transact(work)


def _request(row: AnswerRow) -> KeptRequest:
    if row.status is None or row.media_type is None or row.body is None:
        return KeptRequest(row.key, row.fingerprint, row.asked_at)
    answer = KeptAnswer(row.status, row.media_type, row.body, row.location)
    return KeptRequest(row.key, row.fingerprint, row.asked_at, answer)
