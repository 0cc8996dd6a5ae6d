"""Where a run waits while it is paused."""

import asyncio


class Gate:
    """Open or closed; a run passes it before each position."""

    def __init__(self) -> None:
        self._open = asyncio.Event()
        self._open.set()

    @property
    def closed(self) -> bool:
        """Whether a run that comes here has to wait."""
        return not self._open.is_set()

    def close(self) -> None:
        """Let a run come to rest here."""
        self._open.clear()

    def open(self) -> None:
        """Let it go on."""
        self._open.set()

    async def wait_open(self) -> None:
        """Return when the gate is open."""
        await self._open.wait()
