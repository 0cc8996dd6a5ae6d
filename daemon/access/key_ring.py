"""The keys that are good now: in memory for every request, and read anew as others add and remove them."""

import asyncio
import logging
import time
from datetime import UTC, datetime
from typing import Final

from daemon.access.keys import ApiKey
from daemon.errors import StoreError
from daemon.store.keys import StoredKeys

logger = logging.getLogger(__name__)

REFRESHED: Final = 0.5
"""Seconds after which a key that was added or removed is known to be."""
TOLD: Final = 60.0
"""Seconds after which the store is told of a key's latest use: its `last_used_at` is as good as that."""


class KeyRing:
    """The stored keys by their hashes."""

    def __init__(self, stored: StoredKeys) -> None:
        self._stored = stored
        self._keys: dict[str, ApiKey] = {}
        self._used: dict[str, float] = {}
        """When (Unix time) each key was used that the store has not been told of."""
        self._told = time.monotonic()

    def find(self, digest: str) -> ApiKey | None:
        """Return the key of this hash, which is used by that."""
        key = self._keys.get(digest)
        if key is not None:
            self._used[digest] = time.time()
        return key

    def __contains__(self, key: ApiKey) -> bool:
        return key.digest in self._keys

    def __len__(self) -> int:
        return len(self._keys)

    async def refresh(self) -> None:
        """Read the keys; raises StoreError."""
        self._keys = {key.digest: key for key in await self._stored.all()}

    async def follow(self) -> None:
        """Refresh for ever; while the store cannot be read, the keys that were good stay so."""
        failed = False
        while True:
            await asyncio.sleep(REFRESHED)
            try:
                await self.refresh()
                if self._used and time.monotonic() - self._told > TOLD:
                    await self.tell()
                failed = False
            except StoreError as error:
                if not failed:
                    logger.error("keys that are added or removed now are not noticed: %s", error)  # noqa: TRY400
                failed = True

    async def tell(self) -> None:
        """Let the store know which keys were used when; raises StoreError."""
        used, self._used, self._told = self._used, {}, time.monotonic()
        times = {digest: datetime.fromtimestamp(when, UTC) for digest, when in used.items()}
        try:
            if times:
                await self._stored.used(times)
        except StoreError:
            self._used = used | self._used
            raise
