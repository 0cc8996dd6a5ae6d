"""Who may move: one lease on all motion, for a client as long as it renews it, or for a run until its end."""

import asyncio
import contextlib
import hmac
import logging
import secrets
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

from daemon.errors import LeaseEndedError, LeaseHeldError, LeaseRequiredError

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Lease:
    """The right to move, shown by its token. `ttl` is in seconds; a run's lease has neither ttl nor end."""

    token: str
    owner: str
    note: str
    ttl: float | None
    expires_at: datetime | None


class LeaseDesk:
    """Hands out the one lease, and says when it ends."""

    def __init__(self) -> None:
        self._lease: Lease | None = None
        self._promised: Lease | None = None
        """A run's, while it is being begun."""
        self._expiry: asyncio.TimerHandle | None = None
        self._listeners: list[Callable[[Lease], None]] = []

    @property
    def current(self) -> Lease | None:
        """The lease that is held now, if any."""
        return self._lease

    def on_end(self, listener: Callable[[Lease], None]) -> None:
        """Call `listener` with each lease that ends: expired, released, or handed over to a run."""
        self._listeners.append(listener)

    def acquire(self, owner: str, note: str, ttl: float, token: str | None = None) -> Lease:
        """Give a new lease of `ttl` seconds, or renew the one of `token`.

        Raises LeaseHeldError when somebody else holds it.
        """
        expires_at = datetime.now(UTC) + timedelta(seconds=ttl)
        if self._lease is None:
            self._require_unpromised()
            lease = Lease(secrets.token_urlsafe(18), owner, note, ttl, expires_at)
            logger.info("'%s' may move for %g s (%s)", owner, ttl, note or "no note")
        else:
            self._require_holder(self._lease, token)
            lease = replace(self._lease, owner=owner, note=note, ttl=ttl, expires_at=expires_at)
        self._hold(lease)
        return lease

    def take_over(self, owner: str, note: str, ttl: float) -> tuple[Lease, Lease | None]:
        """Give a new lease in place of another client's, which ends by that; return both.

        Raises LeaseHeldError when a run holds it.
        """
        former = self._lease
        self._require_unpromised()
        if former is not None and former.ttl is None:
            raise LeaseHeldError(f"'{former.owner}' holds the motion lease until it is over: cancel it first")
        if former is not None:
            logger.warning("'%s' takes the lease over from '%s'", owner, former.owner)
            self._end(former)
        return self.acquire(owner, note, ttl), former

    @contextlib.contextmanager
    def handing_over(self, owner: str, note: str, token: str | None = None) -> Generator[Lease]:
        """Give a lease without an end to a run, in place of its starter's, which `token` shows, once the block is done.

        Until then, and where the block raises, the starter's stays as it is, and nobody else gets one.
        Raises LeaseHeldError when somebody else than the starter holds it.
        """
        self._require_unpromised()
        if self._lease is not None:
            self._require_holder(self._lease, token)
        lease = self._promised = Lease(secrets.token_urlsafe(18), owner, note, None, None)
        try:
            yield lease
        finally:
            self._promised = None
        self.close()
        self._hold(lease)

    def require(self, token: str | None) -> Lease:
        """Return the lease that `token` shows.

        Raises LeaseRequiredError without a token, LeaseHeldError when somebody else holds the lease, and
        LeaseEndedError when nobody does.
        """
        if token is None:
            raise LeaseRequiredError(
                "whatever moves needs the motion lease: ask for it with POST /api/v1/lease "
                "and send its token in the header X-Lease"
            )
        if self._lease is None:
            raise LeaseEndedError("this lease has expired or was released: ask for a new one")
        self._require_holder(self._lease, token)
        return self._lease

    def release(self, token: str | None) -> None:
        """End the lease that `token` shows; raises as `require` does."""
        self._end(self.require(token))

    def close(self) -> None:
        """End whatever lease there is."""
        if self._lease is not None:
            self._end(self._lease)

    def _hold(self, lease: Lease) -> None:
        self._lease = lease
        if self._expiry is not None:
            self._expiry.cancel()
            self._expiry = None
        if lease.ttl is not None:
            self._expiry = asyncio.get_running_loop().call_later(lease.ttl, self._expire, lease)

    def _expire(self, lease: Lease) -> None:
        logger.warning("the lease of '%s' has expired", lease.owner)
        self._end(lease)

    def _end(self, lease: Lease) -> None:
        self._lease = None
        if self._expiry is not None:
            self._expiry.cancel()
            self._expiry = None
        for listener in self._listeners:
            listener(lease)

    def _require_unpromised(self) -> None:
        if self._promised is not None:
            raise LeaseHeldError(f"'{self._promised.owner}' is about to hold the motion lease: wait for it")

    def _require_holder(self, lease: Lease, token: str | None) -> None:
        # Compared in constant time: a token is a key.
        if token is None or not hmac.compare_digest(lease.token.encode(), token.encode()):
            until = "" if lease.expires_at is None else f" until {lease.expires_at:%H:%M:%S} UTC"
            note = f" ({lease.note})" if lease.note else ""
            raise LeaseHeldError(f"'{lease.owner}'{note} holds the motion lease{until}: wait, or ask them")
