"""Waking everybody who waits for a change, without keeping anything for those who do not."""

import asyncio


class Broadcast:
    """A change that any number of tasks wait for; what changed is read elsewhere."""

    def __init__(self) -> None:
        self._next = asyncio.Event()

    def fire(self) -> None:
        """Wake all who wait now."""
        fired, self._next = self._next, asyncio.Event()
        fired.set()

    async def wait(self) -> None:
        """Return at the next `fire`."""
        await self._next.wait()
