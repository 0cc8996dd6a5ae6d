"""The tables of the database. Times are in UTC; documents are JSON texts, kept as they were written."""

import dataclasses
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final

from sqlalchemy import (
    Boolean,
    Column,
    DateTime,
    Dialect,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
    TypeDecorator,
    text,
)

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


class UtcDateTime(TypeDecorator[datetime]):
    """A time that goes in and comes out with its zone, which SQLite does not keep."""

    impl = DateTime
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:  # noqa: ARG002
        """Store in UTC."""
        return None if value is None else value.astimezone(UTC).replace(tzinfo=None)

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:  # noqa: ARG002
        """Say that it is UTC."""
        return None if value is None else value.replace(tzinfo=UTC)


TABLES: Final = MetaData()

CALIBRATIONS: Final = Table(
    "calibrations",
    TABLES,
    Column("id", Text, primary_key=True),
    Column("created_at", UtcDateTime, nullable=False),
    Column("method", Text, nullable=False),
    Column("document", Text, nullable=False),
    Column("verification", Text),
    Column("active", Boolean, nullable=False),
    Column("run_id", Text),
    Column("checksum", Text),
    Index("one_active_calibration", "active", unique=True, sqlite_where=text("active")),
)
"""Calibrations, whose documents are never changed.

`verification` is what the held-out views said, as JSON; `checksum` the document's SHA-256, in hexadecimal digits, null
where it was stored by an activecam that kept none.
"""

RUNS: Final = Table(
    "runs",
    TABLES,
    Column("id", Text, primary_key=True),
    Column("state", Text, nullable=False),
    Column("profile_name", Text, nullable=False),
    Column("profile", Text, nullable=False),
    Column("session", Text, nullable=False),
    Column("owner", Text, nullable=False),
    Column("note", Text, nullable=False),
    Column("created_at", UtcDateTime, nullable=False),
    Column("started_at", UtcDateTime),
    Column("ended_at", UtcDateTime),
    Column("error", Text),
    Column("calibration_id", Text, ForeignKey("calibrations.id")),
)
"""Calibration runs; `profile` is as it was when the run was created, `session` its folder, from the data folder."""

ANSWERS: Final = Table(
    "answers",
    TABLES,
    Column("key", Text, primary_key=True),
    Column("fingerprint", Text, nullable=False),
    Column("asked_at", UtcDateTime, nullable=False),
    Column("status", Integer),
    Column("media_type", Text),
    Column("body", LargeBinary),
    Column("location", Text),
)
"""What requests with an idempotency key were answered; one without a status was not answered yet.

`fingerprint` is a hash of what tells the request from others.
"""

API_KEYS: Final = Table(
    "api_keys",
    TABLES,
    Column("name", Text, primary_key=True),
    Column("role", Text, nullable=False),
    Column("digest", Text, nullable=False, unique=True),
    Column("created_at", UtcDateTime, nullable=False),
    Column("last_used_at", UtcDateTime),
)
"""API keys, of which the hashes alone are kept."""

AUDIT: Final = Table(
    "audit",
    TABLES,
    Column("id", Integer, primary_key=True),
    Column("time", UtcDateTime, nullable=False),
    Column("who", Text),
    Column("role", Text, nullable=False),
    Column("address", Text, nullable=False),
    Column("method", Text, nullable=False),
    Column("path", Text, nullable=False),
    Column("asked", Text, nullable=False),
    Column("status", Integer),
    Column("code", Text),
)
"""What somebody did."""


def fields_of(record: "DataclassInstance") -> dict[str, Any]:
    """Return a record's fields, which are columns of its table."""
    return {field.name: getattr(record, field.name) for field in dataclasses.fields(record)}
