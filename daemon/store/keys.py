"""The API keys, kept as their hashes. Every method raises StoreError when the disk fails."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, Row, delete, insert, select, update
from sqlalchemy.exc import IntegrityError

from daemon.access.keys import ApiKey
from daemon.access.roles import Role
from daemon.errors import KeyExistsError, UnknownKeyError
from daemon.store.database import Database
from daemon.store.tables import API_KEYS, fields_of


class StoredKeys:
    """The keys in a database."""

    def __init__(self, database: Database) -> None:
        self._database = database

    async def all(self) -> Sequence[ApiKey]:
        """Return all keys, by name."""
        by_name = select(API_KEYS).order_by(API_KEYS.c.name)
        return await self._database.transact(
            lambda connection: [_key(row) for row in connection.execute(by_name)]
        )

    async def add(self, key: ApiKey) -> None:
        """Store a new key; raises KeyExistsError."""

        def work(connection: Connection) -> None:
            try:
                connection.execute(insert(API_KEYS).values(fields_of(key)))
            except IntegrityError:
                raise KeyExistsError(
                    f"there is a key '{key.name}' already: choose another name, or remove that one first"
                ) from None

        await self._database.transact(work)

    async def remove(self, name: str) -> None:
        """Forget a key; raises UnknownKeyError."""

        def work(connection: Connection) -> None:
            if not connection.execute(delete(API_KEYS).where(API_KEYS.c.name == name)).rowcount:
                raise UnknownKeyError(
                    f"there is no key '{name}': 'activecam key list' lists those that there are"
                )

        await self._database.transact(work)

    async def used(self, times: Mapping[str, datetime]) -> None:
        """Store when the keys of these hashes were used last; those that are gone stay gone."""

        def work(connection: Connection) -> None:
            for digest, time in times.items():
                connection.execute(
                    update(API_KEYS).where(API_KEYS.c.digest == digest).values(last_used_at=time)
                )

        await self._database.transact(work)


def _key(row: Row[Any]) -> ApiKey:
    return ApiKey(row.name, Role(row.role), row.digest, row.created_at, row.last_used_at)
