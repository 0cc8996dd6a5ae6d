"""Whether the disk still takes what the daemon has to keep."""

import asyncio
import math
from typing import Final

from daemon.errors import StoreError
from daemon.store import Store

PATIENCE: Final = 2.0
"""Seconds that the disk may take."""
KEPT: Final = 1.0
"""Seconds for which what was found of the disk is answered again."""


class StoreCheck:
    """Whether the store takes anything. Anybody may ask, without a key: it writes once a second at most."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._looking = asyncio.Lock()
        self._looked_at = -math.inf
        self._problem: str | None = None

    async def problem(self) -> str | None:
        """Return a sentence on what is wrong with it, if anything."""
        loop = asyncio.get_running_loop()
        async with self._looking:
            if loop.time() - self._looked_at >= KEPT:
                self._problem = await self._look()
                self._looked_at = loop.time()
            return self._problem

    async def _look(self) -> str | None:
        try:
            async with asyncio.timeout(PATIENCE):
                await self._store.check_writable()
        except StoreError as error:
            return str(error)
        except TimeoutError:
            return f"the database has taken nothing for {PATIENCE:g} s: is the disk there?"
        return None
