"""The tables of the database, and how values are kept in them: times in UTC, documents as JSON texts."""

import dataclasses
import sqlite3
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

TABLES: Final = (
    # A calibration; its document is never changed. `verification` is what the held-out views said.
    """
    CREATE TABLE calibrations (
        id TEXT NOT NULL PRIMARY KEY,
        created_at DATETIME NOT NULL,
        method TEXT NOT NULL,
        document TEXT NOT NULL,
        verification TEXT,
        active BOOLEAN NOT NULL,
        run_id TEXT
    )
    """,
    "CREATE UNIQUE INDEX one_active_calibration ON calibrations (active) WHERE active",
    # A calibration run; `profile` is as it was when the run was created, `session` the folder from the data folder.
    """
    CREATE TABLE runs (
        id TEXT NOT NULL PRIMARY KEY,
        state TEXT NOT NULL,
        profile_name TEXT NOT NULL,
        profile TEXT NOT NULL,
        session TEXT NOT NULL,
        owner TEXT NOT NULL,
        note TEXT NOT NULL,
        created_at DATETIME NOT NULL,
        started_at DATETIME,
        ended_at DATETIME,
        error TEXT,
        calibration_id TEXT REFERENCES calibrations (id)
    )
    """,
    # What a request with an idempotency key was answered; without a status, it was not answered yet. `fingerprint`
    # is a hash of what tells the request from others.
    """
    CREATE TABLE answers (
        key TEXT NOT NULL PRIMARY KEY,
        fingerprint TEXT NOT NULL,
        asked_at DATETIME NOT NULL,
        status INTEGER,
        media_type TEXT,
        body BLOB,
        location TEXT
    )
    """,
    # An API key, of which the hash alone is kept.
    """
    CREATE TABLE api_keys (
        name TEXT NOT NULL PRIMARY KEY,
        role TEXT NOT NULL,
        digest TEXT NOT NULL UNIQUE,
        created_at DATETIME NOT NULL,
        last_used_at DATETIME
    )
    """,
    # What somebody did.
    """
    CREATE TABLE audit (
        id INTEGER NOT NULL PRIMARY KEY,
        time DATETIME NOT NULL,
        who TEXT,
        role TEXT NOT NULL,
        address TEXT NOT NULL,
        method TEXT NOT NULL,
        path TEXT NOT NULL,
        asked TEXT NOT NULL,
        status INTEGER,
        code TEXT
    )
    """,
)
"""The statements that make an empty database."""


def text_of(time: datetime) -> str:
    """Return a time as it is kept: in UTC, without saying so, and in the order of time when sorted."""
    return time.astimezone(UTC).replace(tzinfo=None).isoformat(" ", "microseconds")


def time_of(text: object) -> datetime:
    """Return a time that was kept; raises ValueError for what is none."""
    return datetime.fromisoformat(str(text)).replace(tzinfo=UTC)


def maybe_time_of(text: object) -> datetime | None:
    """Return a time that may have been left out."""
    return None if text is None else time_of(text)


def insert(
    connection: sqlite3.Connection, table: str, record: "DataclassInstance", *, replace: bool = False
) -> int | None:
    """Store a record whose fields are columns of `table`, `replace` one of the same key; return its row's id."""
    values = {field.name: getattr(record, field.name) for field in dataclasses.fields(record)}
    stored = {
        name: text_of(value) if isinstance(value, datetime) else value for name, value in values.items()
    }
    verb = "REPLACE" if replace else "INSERT"
    columns, places = ", ".join(stored), ", ".join(f":{name}" for name in stored)
    statement = f"{verb} INTO {table} ({columns}) VALUES ({places})"
    return connection.execute(statement, stored).lastrowid
