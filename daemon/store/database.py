"""The SQLite file: durable, of a known schema version, and used by one thread of its own."""

import asyncio
import logging
import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import IO, Any, Final, Self, TypeVar

from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.exc import SQLAlchemyError

from daemon.errors import FolderInUseError, StoreError
from daemon.store.copies import copy_database
from daemon.store.folder_lock import lock_folder
from daemon.store.migrations import migrate, schema_version
from daemon.store.tables import TABLES

logger = logging.getLogger(__name__)

DATABASE: Final = "activecam.db"
"""Its name in the data folder."""

SHARED_MEMORY: Final = 32768
"""Bytes of the file through which those who use the database at the same time know of each other."""

Result = TypeVar("Result")


class Database:
    """`DIR/activecam.db`, and the lock that keeps a second daemon out of the same folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.path = folder / DATABASE
        self.errors = 0
        """How often it could not be used."""
        self._lock: IO[str] | None = None
        self._engine: Engine | None = None
        # One thread: SQLite writes one transaction at a time, and a commit waits for the disk.
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="database")

    @classmethod
    async def open(cls, folder: Path, *, beside_daemon: bool = False) -> Self:
        """Open or create the database in `folder`; one of an older schema is copied, then brought to today's.

        With `beside_daemon` it is used beside the daemon that uses it, if one does, and keeps none out.

        Raises StoreError when the folder cannot be used, another daemon uses it, or the file is of a newer
        schema, or cannot be brought to today's; it is then as it was.
        """
        database = cls(folder)
        try:
            await database._in_thread(database._open_beside if beside_daemon else database._open)
        except BaseException:
            await database.close()
            raise
        return database

    async def close(self) -> None:
        """Finish what is under way and let the file go."""
        await self._in_thread(self._close)
        self._thread.shutdown()

    async def transact(self, work: Callable[[Connection], Result]) -> Result:
        """Run `work` in a transaction of its own, on disk when this returns; raises StoreError."""

        def transaction() -> Result:
            assert self._engine is not None
            with self._engine.begin() as connection:
                return work(connection)

        return await self._in_thread(transaction)

    async def _in_thread(self, work: Callable[[], Result]) -> Result:
        try:
            return await asyncio.get_running_loop().run_in_executor(self._thread, work)
        except SQLAlchemyError as error:
            self.errors += 1
            raise StoreError(f"{self.path}: the database cannot be used: {self._reason_of(error)}") from error
        except ValueError as error:
            raise StoreError(f"{self.path}: a record in the database is damaged: {error}") from error

    def _reason_of(self, error: SQLAlchemyError) -> str:
        """Return what SQLite said, without the statement that it said it of; of a full disk, what to do about it."""
        reason = str(getattr(error, "orig", None) or error).splitlines()[0]
        full = reason == "database or disk is full"
        if reason == "disk I/O error":  # as SQLite says, too, where there is no room for its shared memory
            full = shutil.disk_usage(self.folder).free < SHARED_MEMORY
        return "the disk is full: make room" if full else reason

    def _open(self) -> None:
        self._lock = lock_folder(self.folder)
        self._engine = self._connect()
        self._bring_to_today(self._engine)

    def _open_beside(self) -> None:
        try:
            self._open()
        except FolderInUseError:
            self._engine = self._connect()
            with self._engine.begin() as connection:
                version: int = connection.exec_driver_sql("PRAGMA user_version").scalar_one()
            if version != schema_version():
                raise StoreError(
                    f"{self.path}: used by an activecam of another version (schema {version}, this one knows "
                    f"{schema_version()}): use that version, or stop it first"
                ) from None
        self._let_go()

    def _let_go(self) -> None:
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def _connect(self) -> Engine:
        engine = create_engine(f"sqlite:///{self.path}")
        event.listen(engine, "connect", _make_durable)
        event.listen(engine, "begin", _begin)
        return engine

    def _bring_to_today(self, engine: Engine) -> None:
        with engine.begin() as connection:
            version: int = connection.exec_driver_sql("PRAGMA user_version").scalar_one()
            if version == 0:
                TABLES.create_all(connection)
                connection.exec_driver_sql(f"PRAGMA user_version = {schema_version()}")
        if version > schema_version():
            raise StoreError(
                f"{self.path}: written by a newer activecam (schema {version}, this one knows "
                f"{schema_version()}): install that version, or choose another --data"
            )
        if 0 < version < schema_version():
            self._migrate(engine, version)

    def _migrate(self, engine: Engine, version: int) -> None:
        copy = self.folder / f"activecam.schema-{version}.db"
        copy_database(self.path, copy)
        try:
            with engine.begin() as connection:
                migrate(connection, version)
        except SQLAlchemyError as error:
            raise StoreError(
                f"{self.path}: of schema {version}, and could not be brought to schema {schema_version()} "
                f"({self._reason_of(error)}): it is as it was, so go on with the activecam that wrote it, "
                "and report this"
            ) from error
        logger.warning(
            "%s was of schema %d and is now of schema %d: %s is how it was",
            self.path,
            version,
            schema_version(),
            copy,
        )

    def _close(self) -> None:
        if self._engine is not None:
            self._engine.dispose()
        self._let_go()


def _make_durable(connection: Any, _record: Any) -> None:
    # Left to itself, sqlite3 begins no transaction for a change of the tables; see `_begin`.
    connection.isolation_level = None
    cursor = connection.cursor()
    for pragma in ("journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON", "busy_timeout = 5000"):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()


def _begin(connection: Connection) -> None:
    # A transaction that began to read, and writes when another process has written meanwhile, would be refused.
    connection.exec_driver_sql("BEGIN IMMEDIATE")
