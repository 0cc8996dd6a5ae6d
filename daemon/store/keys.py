"""The API keys, kept as their hashes. Every method raises StoreError when the disk fails."""

from collections.abc import Mapping, Sequence
from datetime import datetime

from sqlalchemy import delete, select, update
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from daemon.access.keys import ApiKey
from daemon.access.roles import Role
from daemon.errors import KeyExistsError, UnknownKeyError
from daemon.store.database import Database
from daemon.store.tables import ApiKeyRow


class StoredKeys:
    """The keys in a database."""

    def __init__(self, database: Database) -> None:
        self._database = database

    async def all(self) -> Sequence[ApiKey]:
        """Return all keys, by name."""
        by_name = select(ApiKeyRow).order_by(ApiKeyRow.name)
        return await self._database.transact(lambda session: [_key(row) for row in session.scalars(by_name)])

    async def add(self, key: ApiKey) -> None:
        """Store a new key; raises KeyExistsError."""

        def work(session: Session) -> None:
            session.add(ApiKeyRow(**{name: getattr(key, name) for name in ApiKey.__dataclass_fields__}))
            try:
                session.flush()
            except IntegrityError:
                raise KeyExistsError(
                    f"there is a key '{key.name}' already: choose another name, or remove that one first"
                ) from None

        await self._database.transact(work)

    async def remove(self, name: str) -> None:
        """Forget a key; raises UnknownKeyError."""

        def work(session: Session) -> None:
            found = session.scalars(
                delete(ApiKeyRow).where(ApiKeyRow.name == name).returning(ApiKeyRow.name)
            ).all()
            if not found:
                raise UnknownKeyError(
                    f"there is no key '{name}': 'activecam key list' lists those that there are"
                )

        await self._database.transact(work)

    async def used(self, times: Mapping[str, datetime]) -> None:
        """Store when the keys of these hashes were used last; those that are gone stay gone."""

        def work(session: Session) -> None:
            for digest, time in times.items():
                session.execute(update(ApiKeyRow).where(ApiKeyRow.digest == digest).values(last_used_at=time))

        await self._database.transact(work)


def _key(row: ApiKeyRow) -> ApiKey:
    return ApiKey(row.name, Role(row.role), row.digest, row.created_at, row.last_used_at)
