"""A clock for tests: time passes only while everybody sleeps, so that no test depends on speed."""

import asyncio
import heapq
from itertools import count

_TICK = 1e-9
_TURNS = 20
"""Turns of the event loop in which nobody wakes another one any more: then time may pass."""


class VirtualClock:
    """Every question takes a nanosecond, every sleep passes as soon as nothing else is to be done."""

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
