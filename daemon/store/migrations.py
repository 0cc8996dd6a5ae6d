"""From the schema of an older activecam to today's, in one transaction: all of it, or nothing.

To change the tables:

1. change `tables`;
2. append to `MIGRATIONS` a function that does the same to a database that has data in it, by SQL alone: `tables` will
   change again, and a migration that has been released never does;
3. `python -m tests.daemon.snapshots` keeps the new schema for the tests, which take every older one there
   and find what was in it again.

Foreign keys are looked at when all is done. A table that SQLite cannot alter is made anew: create it under another
name, copy, drop the old one, rename.
"""

from collections.abc import Callable
from typing import Final

from sqlalchemy import Connection

Migration = Callable[[Connection], None]


def _add_answers(connection: Connection) -> None:
    connection.exec_driver_sql(
        "CREATE TABLE answers (key TEXT NOT NULL, fingerprint TEXT NOT NULL, asked_at DATETIME NOT NULL, "
        "status INTEGER, media_type TEXT, body BLOB, location TEXT, PRIMARY KEY (key))"
    )


def _add_access(connection: Connection) -> None:
    connection.exec_driver_sql(
        "CREATE TABLE api_keys (name TEXT NOT NULL PRIMARY KEY, role TEXT NOT NULL, digest TEXT NOT NULL UNIQUE, "
        "created_at DATETIME NOT NULL, last_used_at DATETIME)"
    )
    connection.exec_driver_sql(
        "CREATE TABLE audit (id INTEGER NOT NULL PRIMARY KEY, time DATETIME NOT NULL, who TEXT, role TEXT NOT NULL, "
        "address TEXT NOT NULL, method TEXT NOT NULL, path TEXT NOT NULL, asked TEXT NOT NULL, status INTEGER, "
        "code TEXT)"
    )


def _add_checksums(connection: Connection) -> None:
    connection.exec_driver_sql("ALTER TABLE calibrations ADD COLUMN checksum TEXT")


MIGRATIONS: Final[tuple[Migration, ...]] = (_add_answers, _add_access, _add_checksums)
"""The first takes schema 1 to schema 2, and so on."""


def schema_version() -> int:
    """Return the schema that this activecam works with; SQLite keeps it as `user_version`."""
    return 1 + len(MIGRATIONS)


def migrate(connection: Connection, version: int) -> None:
    """Bring the database from schema `version` to today's, in the transaction that `connection` is in."""
    connection.exec_driver_sql("PRAGMA defer_foreign_keys = ON")
    for migration in MIGRATIONS[version - 1 :]:
        migration(connection)
    connection.exec_driver_sql(f"PRAGMA user_version = {schema_version()}")
