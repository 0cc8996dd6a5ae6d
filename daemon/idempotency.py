"""Requests that are carried out once, however often they are sent: what each was answered, by its client's key.

As draft-ietf-httpapi-idempotency-key-header has it. An answer is kept for LIFETIME, whatever it was. Those of
requests that leave something behind (runs, activations) are kept on disk. Those of motions and leases are not:
a lease ends with the daemon, so that a motion that is asked for again after a restart is refused for want of it.
"""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Final

from daemon.errors import IdempotencyConflictError, IdempotencyInProgressError, IdempotencyUnknownError
from daemon.store.answers import KeptAnswer, KeptRequest, StoredAnswers

LIFETIME: Final = timedelta(hours=24)
MOST: Final = 10_000
"""Requests that are remembered; beyond that the oldest are forgotten first."""


@dataclass(slots=True)
class _Entry:
    request: KeptRequest
    under_way: bool


class AnswersGiven:
    """What was answered to the requests that had a key."""

    def __init__(self, stored: StoredAnswers) -> None:
        self._stored = stored
        self._entries: dict[str, _Entry] = {}

    async def restore(self) -> None:
        """Take up what an earlier daemon answered; raises StoreError."""
        for request in await self._stored.read(_now() - LIFETIME):
            self._entries[request.key] = _Entry(request, under_way=False)

    async def begin(self, key: str, fingerprint: str, *, durable: bool) -> KeptAnswer | None:
        """Return what the request of this key was answered; None where it is to be carried out now.

        It must then be followed by `settle`, or by `lose`. `fingerprint` says whether it is the same request.
        Raises IdempotencyConflictError where it is not, IdempotencyInProgressError where the first is still under
        way, IdempotencyUnknownError where its end is not known, and StoreError.
        """
        now = _now()
        self._forget(now - LIFETIME, MOST)
        entry = self._entries.get(key)
        if entry is None:
            self._forget(now - LIFETIME, MOST - 1)
            request = KeptRequest(key, fingerprint, now)
            self._entries[key] = _Entry(request, under_way=True)
            if durable:
                await self._keep(request)
            return None
        if entry.request.fingerprint != fingerprint:
            raise IdempotencyConflictError(
                "another request was sent with this Idempotency-Key: use a new one for each request"
            )
        if entry.under_way:
            raise IdempotencyInProgressError(
                "the request that was first sent with this Idempotency-Key is still under way: wait, then send it again"
            )
        if entry.request.answer is None:
            raise IdempotencyUnknownError(
                "the daemon ended before it had answered the request that was first sent with this Idempotency-Key: "
                "see what came of it, and use a new key to ask again"
            )
        return entry.request.answer

    async def settle(self, key: str, answer: KeptAnswer, *, durable: bool) -> None:
        """Remember what the request was answered; raises StoreError, and remembers it until the end all the same."""
        entry = self._entries.get(key)
        if entry is not None:
            entry.request, entry.under_way = entry.request.answered(answer), False
        if durable:
            await self._stored.settle(key, answer)

    def lose(self, key: str) -> None:
        """Remember that the request was begun, and that nobody knows how it ended."""
        entry = self._entries.get(key)
        if entry is not None:
            entry.under_way = False

    async def _keep(self, request: KeptRequest) -> None:
        try:
            await self._stored.add(request, request.asked_at - LIFETIME)
        except BaseException:
            del self._entries[request.key]
            raise

    def _forget(self, oldest: datetime, most: int) -> None:
        """Forget what was asked before `oldest`, and of the rest all but the newest; they are in that order."""
        for key in list(self._entries):
            if self._entries[key].request.asked_at >= oldest and len(self._entries) <= most:
                break
            del self._entries[key]


def _now() -> datetime:
    return datetime.now(UTC)
