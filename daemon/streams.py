"""Answers that do not end by themselves, and how a shutdown ends them."""

import asyncio
import contextlib
from collections.abc import AsyncGenerator, AsyncIterator, Generator
from typing import Any, Final, TypeVar

Item = TypeVar("Item")

HEARTBEAT: Final = 15.0
"""Seconds of silence after which a stream shows that it lives, before a proxy takes it for dead."""


class Streams:
    """What long answers go through: once closed, all of them end. A server waits for its answers to end."""

    def __init__(self) -> None:
        self._closing = asyncio.Event()
        self._none = asyncio.Event()
        self._none.set()
        self.open = 0
        """How many streams there are now."""

    def close(self) -> None:
        """End all streams, and let no new one last."""
        self._closing.set()

    async def ended(self) -> None:
        """Return once there are none."""
        await self._none.wait()

    async def follow(self, items: AsyncIterator[Item]) -> AsyncGenerator[Item | None]:
        """Yield `items`, and None after each HEARTBEAT of silence, until they end or the streams do."""
        with self._counted():
            closing = asyncio.ensure_future(self._closing.wait())
            upcoming: asyncio.Future[Item | _End] = asyncio.ensure_future(anext(items, _END))
            try:
                while not self._closing.is_set():
                    waiting: set[asyncio.Future[Any]] = {closing, upcoming}
                    done, _ = await asyncio.wait(
                        waiting, timeout=HEARTBEAT, return_when=asyncio.FIRST_COMPLETED
                    )
                    if not done:
                        yield None
                    if upcoming in done:
                        item = upcoming.result()
                        if isinstance(item, _End):
                            return
                        yield item
                        upcoming = asyncio.ensure_future(anext(items, _END))
            finally:
                for task in (closing, upcoming):
                    task.cancel()
                await asyncio.gather(closing, upcoming, return_exceptions=True)

    @contextlib.contextmanager
    def _counted(self) -> Generator[None]:
        self.open += 1
        self._none.clear()
        try:
            yield
        finally:
            self.open -= 1
            if not self.open:
                self._none.set()


class _End:
    """What follows the last item."""


_END: Final = _End()
