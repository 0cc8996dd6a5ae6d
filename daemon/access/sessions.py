"""Browsers that have shown a key once: a secret of their own stands for it, in memory and for a time."""

import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from daemon.access.keys import ApiKey, digest_of

LIFE: Final = 12 * 3600.0
"""Seconds that a session lasts: a working day."""
MOST: Final = 32
"""Sessions of one key at once; the oldest ends with the next."""


@dataclass(frozen=True, slots=True)
class Session:
    """One browser, known by the hash of its secret, until `ends_at` of the monotonic clock."""

    digest: str
    key: ApiKey
    ends_at: float


class Sessions:
    """The sessions there are, which end with the daemon."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._sessions: dict[str, Session] = {}

    def begin(self, key: ApiKey) -> str:
        """Return the secret of a new session of `key`."""
        self._sessions = {
            digest: each for digest, each in self._sessions.items() if each.ends_at > self._now()
        }
        older = [digest for digest, each in self._sessions.items() if each.key.digest == key.digest]
        for digest in older[: 1 - MOST]:
            del self._sessions[digest]
        secret = secrets.token_urlsafe(32)
        session = Session(digest_of(secret.encode()), key, self._now() + LIFE)
        self._sessions[session.digest] = session
        return secret

    def find(self, digest: str) -> Session | None:
        """Return the session whose secret has this hash."""
        session = self._sessions.get(digest)
        return None if session is None or session.ends_at <= self._now() else session

    def end(self, digest: str) -> None:
        """End a session, if there is one."""
        self._sessions.pop(digest, None)
