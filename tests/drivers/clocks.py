"""Clocks for tests, so that none depends on speed."""

import asyncio
import heapq
import time
from itertools import count

_TICK = 1e-9
_TURNS = 20
"""Turns of the event loop in which nobody wakes another one any more: then time may pass."""

_BEAT = 0.005
"""Seconds between two turns of the event loop that a `PatientClock` asks for."""
_LONGEST_BEAT = 0.02
"""What the time between two of them counts for at most (s)."""


class VirtualClock:
    """Time passes only while everybody sleeps.

    Every question takes a nanosecond, every sleep passes as soon as nothing else is to be done.
    """

    def __init__(self) -> None:
        self._now = 0.0
        self._sleepers: list[tuple[float, int, asyncio.Future[None]]] = []
        self._order = count()
        self._passing: asyncio.Task[None] | None = None

    def now(self) -> float:
        self._now += _TICK
        return self._now

    async def sleep(self, seconds: float) -> None:
        woken = asyncio.get_running_loop().create_future()
        heapq.heappush(self._sleepers, (self._now + max(0.0, seconds), next(self._order), woken))
        if self._passing is None or self._passing.done():
            self._passing = asyncio.create_task(self._pass())
        await woken

    async def _pass(self) -> None:
        while self._sleepers:
            for _ in range(_TURNS):
                await asyncio.sleep(0)
            when, _, woken = heapq.heappop(self._sleepers)
            if not woken.done():
                self._now = max(self._now, when)
                woken.set_result(None)


class PatientClock:
    """The time of life, without that in which the event loop was held up.

    An emulated device shares the loop with the program that watches it. On a busy machine it gets on no faster than
    that does, as a real one would.
    """

    def __init__(self) -> None:
        self._beaten = time.monotonic(), 0.0
        """When the loop had its latest turn, and what time this clock said then."""
        self._loop = asyncio.get_running_loop()
        self._beat()

    def now(self) -> float:
        return self._at(time.monotonic())

    async def sleep(self, seconds: float) -> None:
        until, left = self.now() + seconds, seconds
        while True:
            await asyncio.sleep(min(left, _LONGEST_BEAT))
            left = until - self.now()
            if left <= 0:
                return

    def _at(self, instant: float) -> float:
        beaten_at, said = self._beaten
        return said + min(instant - beaten_at, _LONGEST_BEAT)

    def _beat(self) -> None:
        instant = time.monotonic()
        self._beaten = instant, self._at(instant)
        self._loop.call_later(_BEAT, self._beat)
