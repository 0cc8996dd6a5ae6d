"""An event loop on which waiting takes no time: its clock jumps to the next timer once nothing else is left to do.

Threads are waited for, so that the clock stands while they work: what happens is the same on a busy machine as on an
idle one, and hours of a rig's life pass in seconds.
"""

import asyncio
import selectors
import threading
from collections.abc import Callable
from concurrent.futures import Executor
from datetime import UTC, datetime, timedelta
from typing import Any

BEGIN = datetime(2026, 3, 14, 9, 26, 53, tzinfo=UTC)
LOOK = 0.002
"""Seconds of the machine's clock between two looks at whether threads are done."""


class VirtualTimeLoop(asyncio.SelectorEventLoop):
    """A loop whose `time` begins at 0 and passes only while everybody waits."""

    def __init__(self) -> None:
        self._now = 0.0
        self._threads = 0
        super().__init__(_Selector(self))

    def time(self) -> float:
        return self._now

    def run_in_executor(
        self, executor: Executor | None, func: Callable[..., Any], *args: Any
    ) -> asyncio.Future[Any]:
        def done(_: asyncio.Future[Any]) -> None:
            self._threads -= 1

        future = super().run_in_executor(executor, func, *args)
        self._threads += 1
        future.add_done_callback(done)
        return future

    async def shutdown_default_executor(self, timeout: float | None = None) -> None:  # noqa: ASYNC109  as asyncio's own
        self._threads += 1
        try:
            await super().shutdown_default_executor()
        finally:
            self._threads -= 1

    @property
    def at_work(self) -> bool:
        """Whether a thread is doing something that somebody may be waiting for."""
        return self._threads > 0 or any(thread.name == "worker" for thread in threading.enumerate())

    def advance(self, seconds: float) -> None:
        self._now += seconds


class _Selector(selectors.DefaultSelector):
    """Does not wait for timers, but lets the loop's clock reach them."""

    def __init__(self, loop: VirtualTimeLoop) -> None:
        super().__init__()
        self._loop = loop

    def select(self, timeout: float | None = None) -> Any:
        ready = super().select(0)
        if ready or timeout == 0:
            return ready
        if self._loop.at_work:
            return super().select(LOOK)
        if timeout is None:
            return super().select(None)
        self._loop.advance(timeout)
        return ready


class LoopClock:
    """A rig's clock (`drivers.clock.Clock`) that is its loop's."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop

    def now(self) -> float:
        return self._loop.time()

    async def sleep(self, seconds: float) -> None:
        await asyncio.sleep(seconds)

    def utc(self) -> type[datetime]:
        """Return `datetime` for a machine whose own clock goes with this one."""
        loop = self._loop

        class VirtualDatetime(datetime):
            @classmethod
            def now(cls, tz: Any = None) -> Any:
                return BEGIN + timedelta(seconds=loop.time())

        return VirtualDatetime
