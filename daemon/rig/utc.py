"""The rig's clock in UTC and back, without the jitter of reading two clocks one after the other."""

from collections import deque
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Final

from daemon.errors import TimeNotCoveredError
from drivers.clock import Clock

STEP: Final = timedelta(milliseconds=5)
"""What the machine's clock must be out by to have been set; less is the time between reading two clocks.

A clock that is slewed rather than set takes the monotonic clock along."""
AT_ONCE: Final = 1e-3
"""Seconds of life within which both clocks must have been read for their difference to mean something."""
TRIES: Final = 10
"""How often that is tried, where a busy machine is busy with something else in between."""
REMEMBERED: Final = 16
"""How many settings of the machine's clock are remembered."""


@dataclass(slots=True)
class _Era:
    """A time in which the machine's clock was not set: it began at `utc`, and was last looked at at `end`."""

    begin: float
    end: float
    utc: datetime


class UtcClock:
    """Turns the rig's time stamps into UTC, as the machine's clock said it then, and UTC into stamps.

    `check` is to be called often: a setting of the machine's clock is placed between two checks.
    """

    def __init__(self, clock: Clock, pace: float) -> None:
        """`pace`: how many seconds of the rig's clock pass in one of life."""
        self._clock = clock
        self._pace = pace
        while (read := self._read()) is None:
            pass
        stamp, utc = read
        self._eras = deque([_Era(stamp, stamp, utc)], REMEMBERED)

    def check(self) -> bool:
        """Notice whether the machine's clock has been set; return whether it could be looked at."""
        read = self._read()
        if read is None:
            return False
        stamp, utc = read
        if abs(utc - self._utc(self._eras[-1], stamp)) > STEP:
            self._eras.append(_Era(stamp, stamp, utc))
        else:
            self._eras[-1].end = stamp
        return True

    def at(self, timestamp: float) -> datetime:
        """Return the UTC time of a stamp (s) of the rig's clock, in order as long as nobody sets the machine's."""
        self.check()
        for era in self._eras:
            if timestamp <= era.end:
                return self._utc(era, timestamp)
        return self._utc(self._eras[-1], timestamp)

    def stamp(self, time: datetime) -> float:
        """Return when it was `time` on the rig's clock (s).

        Raises TimeNotCoveredError for a time to come, one before this clock was made, and one that a setting of the
        machine's clock has left out or made come twice.
        """
        for _ in range(TRIES):  # or a time that has passed would be one to come
            if self.check():
                break
        stamps = [(era, era.begin + (time - era.utc).total_seconds() * self._pace) for era in self._eras]
        found = [stamp for era, stamp in stamps if era.begin <= stamp <= era.end]
        if len(found) == 1:
            return found[0]
        (oldest, first), (newest, last) = stamps[0], stamps[-1]
        if found:
            reason = "this machine's clock was set back, so that this time came twice: ask for another"
        elif last > newest.end:
            ahead = (last - newest.end) / self._pace
            reason = f"it is {ahead:.3g} s ahead of this machine's clock: ask for a time that has passed"
        elif first < oldest.begin:
            reason = "no axis had been read by then: ask for a later time"
        else:
            reason = "this machine's clock was set about then: ask for another time"
        raise TimeNotCoveredError(f"there are no readings of {rfc3339(time)}: {reason}")

    def _read(self) -> tuple[float, datetime] | None:
        """Return the rig's clock and the machine's, None where they could not be read at once."""
        before, utc, after = self._clock.now(), datetime.now(UTC), self._clock.now()
        return (before, utc) if (after - before) / self._pace < AT_ONCE else None

    def _utc(self, era: _Era, stamp: float) -> datetime:
        return era.utc + timedelta(seconds=(stamp - era.begin) / self._pace)


def rfc3339(time: datetime) -> str:
    """Return `time`, which is in UTC, as RFC 3339."""
    return time.astimezone(UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")
