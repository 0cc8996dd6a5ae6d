"""The book of what was done: written on disk in a moment, without anybody's waiting for it."""

import asyncio
import logging
from collections.abc import Sequence
from typing import Final

from daemon.access.entries import AuditEntry
from daemon.errors import StoreError
from daemon.store.audit import StoredAudit

logger = logging.getLogger(__name__)

GATHERED: Final = 0.05
"""Seconds for which entries gather before they are written together."""
AGAIN: Final = 5.0
"""Seconds after which it is tried again, where the disk did not take them."""
UNWRITTEN: Final = 10_000
"""Entries that are held for such a disk; the oldest are lost first."""


class AuditBook:
    """Entries that begin when something is asked, and end with its outcome."""

    def __init__(self, stored: StoredAudit) -> None:
        self._stored = stored
        self._unwritten: dict[AuditEntry, None] = {}
        self._some = asyncio.Event()
        self._writing = asyncio.Lock()

    def note(self, entry: AuditEntry) -> None:
        """Have `entry` written as it is in a moment; again whenever it has changed."""
        self._unwritten[entry] = None
        self._some.set()

    async def read(self, before: int | None = None, limit: int = 100) -> Sequence[AuditEntry]:
        """Return the newest entries, older than that of number `before`, the newest first; raises StoreError."""
        await self.write()
        return await self._stored.read(before, limit)

    async def keep(self) -> None:
        """Write for ever what is noted."""
        pause = GATHERED
        while True:
            await self._some.wait()
            await asyncio.sleep(pause)
            try:
                await self.write()
                pause = GATHERED
            except StoreError as error:
                if pause == GATHERED:
                    logger.error("the audit log cannot be written: %s", error)  # noqa: TRY400
                pause = AGAIN

    async def write(self) -> None:
        """Write what is noted; raises StoreError, after which it is still to be written."""
        async with self._writing:
            entries, self._unwritten = self._unwritten, {}
            self._some.clear()
            try:
                await self._stored.write(entries)
            except StoreError:
                self._hold(entries)
                raise

    def _hold(self, entries: dict[AuditEntry, None]) -> None:
        held = list(entries | self._unwritten)
        if len(held) > UNWRITTEN:
            logger.error("%d entries of the audit log are lost", len(held) - UNWRITTEN)
        self._unwritten = dict.fromkeys(held[-UNWRITTEN:])
        self._some.set()
