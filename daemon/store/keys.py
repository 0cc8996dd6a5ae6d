"""The API keys, kept as their hashes. Every method raises StoreError when the disk fails."""

import sqlite3
from collections.abc import Mapping, Sequence
from datetime import datetime

from daemon.access.keys import ApiKey
from daemon.access.roles import Role
from daemon.errors import KeyExistsError, UnknownKeyError
from daemon.store.database import Database
from daemon.store.tables import insert, maybe_time_of, text_of, time_of


class StoredKeys:
    """The keys in a database."""

    def __init__(self, database: Database) -> None:
        self._database = database

    async def all(self) -> Sequence[ApiKey]:
        """Return all keys, by name."""
        return await self._database.transact(
            lambda connection: [
                _key(row) for row in connection.execute("SELECT * FROM api_keys ORDER BY name")
            ]
        )

    async def add(self, key: ApiKey) -> None:
        """Store a new key; raises KeyExistsError."""

        def work(connection: sqlite3.Connection) -> None:
            try:
                insert(connection, "api_keys", key)
            except sqlite3.IntegrityError:
                raise KeyExistsError(
                    f"there is a key '{key.name}' already: choose another name, or remove that one first"
                ) from None

        await self._database.transact(work)

    async def remove(self, name: str) -> None:
        """Forget a key; raises UnknownKeyError."""

        def work(connection: sqlite3.Connection) -> None:
            if not connection.execute("DELETE FROM api_keys WHERE name = ?", (name,)).rowcount:
                raise UnknownKeyError(
                    f"there is no key '{name}': 'activecam key list' lists those that there are"
                )

        await self._database.transact(work)

    async def used(self, times: Mapping[str, datetime]) -> None:
        """Store when the keys of these hashes were used last; those that are gone stay gone."""

        def work(connection: sqlite3.Connection) -> None:
            connection.executemany(
                "UPDATE api_keys SET last_used_at = ? WHERE digest = ?",
                [(text_of(time), digest) for digest, time in times.items()],
            )

        await self._database.transact(work)


def _key(row: sqlite3.Row) -> ApiKey:
    return ApiKey(
        row["name"],
        Role(row["role"]),
        row["digest"],
        time_of(row["created_at"]),
        maybe_time_of(row["last_used_at"]),
    )
