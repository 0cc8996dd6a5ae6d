"""The rig's clock in UTC, without the jitter of reading two clocks one after the other."""

from datetime import UTC, datetime, timedelta
from typing import Final

from drivers.clock import Clock

STEP: Final = timedelta(milliseconds=100)
"""What the machine's clock must be out by to have been set; less is the time between reading two clocks."""
AT_ONCE: Final = 1e-3
"""Seconds of life within which both clocks must have been read for their difference to mean something."""


class UtcClock:
    """Turns the rig's time stamps into UTC: in order as long as nobody sets the machine's clock."""

    def __init__(self, clock: Clock, pace: float) -> None:
        """`pace`: how many seconds of the rig's clock pass in one of life."""
        self._clock = clock
        self._pace = pace
        self._origin = clock.now(), datetime.now(UTC)

    def at(self, timestamp: float) -> datetime:
        """Return the UTC time of a stamp (s) of the rig's clock."""
        before, utc, after = self._clock.now(), datetime.now(UTC), self._clock.now()
        if (after - before) / self._pace < AT_ONCE and abs(utc - self._convert(before)) > STEP:
            self._origin = before, utc
        return self._convert(timestamp)

    def _convert(self, timestamp: float) -> datetime:
        stamp, utc = self._origin
        return utc + timedelta(seconds=(timestamp - stamp) / self._pace)
