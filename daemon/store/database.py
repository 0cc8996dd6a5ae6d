"""The SQLite file: durable, of a known schema version, and used by one thread of its own."""

import asyncio
import fcntl
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import IO, Any, Self, TypeVar

from sqlalchemy import Connection, Engine, create_engine, event, text
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from daemon.errors import StoreError
from daemon.store.tables import SCHEMA_VERSION, Table

Result = TypeVar("Result")


class Database:
    """`DIR/activecam.db`, and the lock that keeps a second daemon out of the same folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.path = folder / "activecam.db"
        self._lock: IO[str] | None = None
        self._engine: Engine | None = None
        # One thread: SQLite writes one transaction at a time, and a commit waits for the disk.
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="database")

    @classmethod
    async def open(cls, folder: Path) -> Self:
        """Open or create the database in `folder`.

        Raises StoreError when the folder cannot be used, another daemon uses it, or the file is of a newer
        schema.
        """
        database = cls(folder)
        try:
            await database._in_thread(database._open)
        except BaseException:
            await database.close()
            raise
        return database

    async def close(self) -> None:
        """Finish what is under way and let the file go."""
        await self._in_thread(self._close)
        self._thread.shutdown()

    async def transact(self, work: Callable[[Session], Result]) -> Result:
        """Run `work` in a transaction of its own, on disk when this returns; raises StoreError."""

        def transaction() -> Result:
            # Records are made inside the transaction, so nothing needs the rows after it.
            with Session(self._engine) as session, session.begin():
                return work(session)

        return await self._in_thread(transaction)

    async def _in_thread(self, work: Callable[[], Result]) -> Result:
        try:
            return await asyncio.get_running_loop().run_in_executor(self._thread, work)
        except SQLAlchemyError as error:
            reason = str(getattr(error, "orig", None) or error).splitlines()[0]
            raise StoreError(f"{self.path}: the database cannot be used: {reason}") from error

    def _open(self) -> None:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = (self.folder / "activecam.lock").open("w")
        except OSError as error:
            raise StoreError(f"{self.folder}: the data folder cannot be used: {error.strerror}") from error
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise StoreError(
                f"{self.folder}: another activecam uses this data folder: stop it, or choose another --data"
            ) from None
        self._engine = create_engine(f"sqlite:///{self.path}")
        event.listen(self._engine, "connect", _make_durable)
        with self._engine.begin() as connection:
            self._check_version(connection)

    def _check_version(self, connection: Connection) -> None:
        version = connection.execute(text("PRAGMA user_version")).scalar_one()
        if version > SCHEMA_VERSION:
            raise StoreError(
                f"{self.path}: written by a newer activecam (schema {version}, this one knows "
                f"{SCHEMA_VERSION}): install that version, or choose another --data"
            )
        if version == 0:
            Table.metadata.create_all(connection)
            connection.execute(text(f"PRAGMA user_version = {SCHEMA_VERSION}"))

    def _close(self) -> None:
        if self._engine is not None:
            self._engine.dispose()
        if self._lock is not None:
            self._lock.close()


def _make_durable(connection: Any, _record: Any) -> None:
    cursor = connection.cursor()
    for pragma in ("journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON", "busy_timeout = 5000"):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()
