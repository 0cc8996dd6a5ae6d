"""Who asks: whoever reaches the daemon, or the holder of a key, as it was told at its start."""

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Final

from daemon.access.book import AuditBook
from daemon.access.key_ring import KeyRing
from daemon.access.keys import ApiKey, digest_of
from daemon.access.roles import Role
from daemon.access.sessions import Sessions
from daemon.errors import KeyRequiredError, KeyUnknownError, NoKeyError, StoreError
from daemon.store import Store

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Caller:
    """Who asks; `session` is the hash of a browser's secret, where that has shown the key before."""

    role: Role
    key: ApiKey | None = None
    session: str | None = None


ANYBODY: Final = Caller(Role.ADMIN)
"""Who asks where nobody is asked for a key: somebody on this machine."""


class Access:
    """Keys, sessions and the book. See `running_access`."""

    def __init__(self, store: Store, *, keys_asked: bool) -> None:
        self.keys_asked = keys_asked
        self.book = AuditBook(store.audit)
        self.ring = KeyRing(store.keys)
        self.sessions = Sessions()

    def identify(self, authorization: bytes | None, cookie: str | None) -> Caller:
        """Return who shows this header Authorization, or else this cookie.

        Raises KeyRequiredError where there is neither, and KeyUnknownError.
        """
        if not self.keys_asked:
            return ANYBODY
        if authorization is not None:
            scheme, _, secret = authorization.partition(b" ")
            key = self.ring.find(digest_of(secret.strip())) if scheme.lower() == b"bearer" else None
            if key is None:
                raise KeyUnknownError(
                    "this key is not known here: send 'Authorization: Bearer KEY' "
                    "with one that 'activecam key add' has printed"
                )
            return Caller(key.role, key)
        if cookie is not None:
            session = self.sessions.find(digest_of(cookie.encode()))
            key = None if session is None else self.ring.find(session.key.digest)
            if session is None or key is None:
                raise KeyUnknownError("this session is over: show a key to POST /api/v1/session")
            return Caller(key.role, key, session.digest)
        raise KeyRequiredError(
            "a key is needed here: send 'Authorization: Bearer KEY'; 'activecam key add' makes one"
        )

    def still_knows(self, caller: Caller) -> bool:
        """Whether the key, or the session, that `caller` has shown is still good."""
        if caller.key is None:
            return True
        if caller.session is not None and self.sessions.find(caller.session) is None:
            return False
        return caller.key in self.ring


@contextlib.asynccontextmanager
async def running_access(store: Store, *, keys_asked: bool) -> AsyncIterator[Access]:
    """Keep the book, and the keys where they are asked for, up to date; on leaving, all is written.

    Raises NoKeyError where keys are asked for and there is none, and StoreError.
    """
    access = Access(store, keys_asked=keys_asked)
    kept = [access.book.keep]
    if keys_asked:
        await access.ring.refresh()
        if not len(access.ring):
            raise NoKeyError(
                "nobody could use this daemon: it asks for a key, and there is none; make one with "
                "'activecam key add', or listen on this machine alone"
            )
        kept.append(access.ring.follow)
    tasks = [asyncio.create_task(keep()) for keep in kept]
    try:
        yield access
    finally:
        try:
            await access.ring.tell()
            await access.book.write()
        except StoreError as error:
            logger.error("the last of the audit log could not be written: %s", error)  # noqa: TRY400
        finally:
            # Only now: a write that was cancelled would be done all the same, and then once more.
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
