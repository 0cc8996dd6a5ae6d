"""The readings of the last minute, and what they were at any instant between two of them."""

import math
from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import islice
from operator import itemgetter
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from daemon.errors import TimeNotCoveredError
from daemon.rig.snapshot import AxisSnapshot
from daemon.rig.utc import UtcClock, rfc3339
from drivers.axis import AxisSpec

Array = NDArray[np.float64]

KEPT: Final = 60.0
"""Seconds of life for which readings are kept."""
MOST: Final = 10_000
"""Readings kept of an axis, however fast it is read."""


class _Reading(NamedTuple):
    timestamp: float
    position: float
    approached: float
    moving: float
    joined: float
    """Whether the axis was neither lost nor unhomed since the reading before this one."""


_BEGINNING: Final = _Reading(-math.inf, math.nan, 0, False, False)
_END: Final = _Reading(math.inf, math.nan, 0, False, False)
_when = itemgetter(0)


@dataclass(frozen=True, slots=True, eq=False)
class PastReadings:
    """The readings at n past instants of m axes, in chain order.

    `values` (n, m) are interpolated `between` readings of two times (n, m, 2), and off by `bounds` (n, m) at the most,
    both in each axis's reading unit. `approached` (n, m) as in `AxisSnapshot`; `moving` (n,) if any axis was.
    """

    values: Array
    approached: NDArray[np.int_]
    between: list[list[tuple[datetime, datetime]]]
    bounds: Array
    moving: NDArray[np.bool_]


class ReadingHistory:
    """What has been read of each axis lately, each reading by its own time."""

    def __init__(self, specs: Iterable[AxisSpec], utc: UtcClock, pace: float, longest_gap: float) -> None:
        """`pace`: seconds of the rig's clock in one of life; `longest_gap` (s of life) between two readings."""
        self._axes = [_AxisHistory(spec, KEPT * pace, longest_gap * pace) for spec in specs]
        self._utc = utc

    def note(self, axes: Iterable[AxisSnapshot]) -> None:
        """Keep what is new in the state of `axes`, which are those of the rig in chain order."""
        for history, axis in zip(self._axes, axes, strict=True):
            history.note(axis)

    def at(self, stamps: Sequence[float]) -> PastReadings:
        """Return what the readings were at `stamps` (rig's clock, s).

        Raises TimeNotCoveredError where an axis has no readings around one of them.
        """
        when = np.array(stamps, dtype=float)
        parts = []
        for history in self._axes:
            part = history.at(when)
            if not part.known.all():
                time = rfc3339(self._utc.at(float(when[np.argmin(part.known)])))
                raise TimeNotCoveredError(
                    f"axis '{history.spec.name}' has no readings around {time}: they are kept for {KEPT:g} s, and "
                    "there are none while it is lost or not homed"
                )
            parts.append(part)
        at, between = self._utc.at, [part.between.tolist() for part in parts]
        return PastReadings(
            np.stack([part.values for part in parts], axis=1),
            np.stack([part.approached for part in parts], axis=1),
            [[(at(first), at(last)) for first, last in row] for row in zip(*between, strict=True)],
            np.stack([part.bounds for part in parts], axis=1),
            np.any([part.moving for part in parts], axis=0),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Interpolated:
    """Of one axis at n instants; what is not `known` means nothing."""

    known: NDArray[np.bool_]
    values: Array
    approached: NDArray[np.int_]
    between: Array
    bounds: Array
    moving: NDArray[np.bool_]


class _AxisHistory:
    """The readings of one axis, the oldest first."""

    def __init__(self, spec: AxisSpec, kept: float, longest_gap: float) -> None:
        self.spec = spec
        self._kept = kept
        self._longest_gap = longest_gap
        self._readings: deque[_Reading] = deque(maxlen=MOST)
        self._joined = False

    def note(self, axis: AxisSnapshot) -> None:
        """Keep the axis's reading, if it is new; more may be known of one that is not."""
        if axis.lost is not None or not axis.homed or axis.position is None or axis.timestamp is None:
            self._joined = False
            return
        newest = self._readings[-1] if self._readings else None
        if newest is not None and axis.timestamp <= newest.timestamp:
            if axis.timestamp == newest.timestamp:
                self._readings[-1] = newest._replace(approached=axis.approached, moving=axis.moving)
            return
        self._readings.append(
            _Reading(axis.timestamp, axis.position, axis.approached, axis.moving, self._joined)
        )
        self._joined = True
        while self._readings[0].timestamp < axis.timestamp - self._kept:
            self._readings.popleft()

    def at(self, stamps: Array) -> _Interpolated:
        """Interpolate linearly at `stamps` (n,)."""
        rows = self._around(stamps.min(), stamps.max())
        # The readings before and after each instant; one and the same where it was read just then.
        after = np.searchsorted(rows[:, 0], stamps)
        before = after - (rows[after, 0] != stamps)
        start, end = rows[before], rows[after]
        span, since, until = end[:, 0] - start[:, 0], stamps - start[:, 0], end[:, 0] - stamps
        moving = (start[:, 3] != 0) | (end[:, 3] != 0)
        with np.errstate(invalid="ignore"):  # where nothing is known
            change = end[:, 1] - start[:, 1]
            still = ~moving & (np.abs(change) <= self.spec.tolerance)
            return _Interpolated(
                known=(before == after) | ((end[:, 4] != 0) & (span <= self._longest_gap)),
                values=start[:, 1] + change * since / np.where(span > 0, span, 1.0),
                approached=np.where(start[:, 2] == end[:, 2], start[:, 2], 0).astype(int),
                between=np.stack([start[:, 0], end[:, 0]], axis=1),
                # What a straight line misses of a curve between two of its points.
                bounds=np.where(still, 0.0, 0.5 * self.spec.acceleration * since * until),
                moving=moving,
            )

    def _around(self, first: float, last: float) -> Array:
        """Return the readings (k, 5) from the last one before `first` to the first one after `last`.

        Nothing is known of the first and the last row where there is none.
        """
        begin = max(bisect_left(self._readings, first, key=_when) - 1, 0)
        end = bisect_right(self._readings, last, key=_when) + 1
        return np.array([_BEGINNING, *islice(self._readings, begin, end), _END], dtype=float)
