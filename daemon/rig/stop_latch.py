"""The latch of the stop: once engaged, nothing moves before a person has said that they know."""

from collections.abc import Callable
from datetime import UTC, datetime

from daemon.errors import StopLatchedError


class StopLatch:
    """Engaged or not, since when and why. It begins free, as a daemon begins with all axes still."""

    def __init__(self) -> None:
        self.reason: str | None = None
        self.since: datetime | None = None
        self._for_good = False
        self._listeners: list[Callable[[str], None]] = []

    @property
    def engaged(self) -> bool:
        """Whether a stop waits to be acknowledged."""
        return self.reason is not None

    def on_engage(self, listener: Callable[[str], None]) -> None:
        """Call `listener` with the reason of each stop."""
        self._listeners.append(listener)

    def engage(self, reason: str, *, for_good: bool = False) -> None:
        """Refuse all motion from now on; the first reason stays until it is acknowledged, if it can be.

        `for_good` is whether nobody can: who acknowledges a stop while the daemon shuts down sets nothing in motion.
        """
        self._for_good = self._for_good or for_good
        if self.reason is None:
            self.reason, self.since = reason, datetime.now(UTC)
        for listener in self._listeners:
            listener(reason)

    def acknowledge(self) -> None:
        """Allow motion again, unless it is refused for good."""
        if not self._for_good:
            self.reason = self.since = None

    def require_free(self) -> None:
        """Raise StopLatchedError while engaged."""
        if self.reason is not None:
            raise StopLatchedError(f"nothing may move: {self.reason}; acknowledge the stop first")
