"""The tables of the database. Times are in UTC; documents are JSON texts, kept as they were written."""

from datetime import UTC, datetime

from sqlalchemy import DateTime, Dialect, ForeignKey, Index, Text, TypeDecorator, text
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column


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


class Table(DeclarativeBase):
    """Base of the tables."""

    type_annotation_map = {datetime: UtcDateTime, str: Text}  # noqa: RUF012  SQLAlchemy reads it so


class RunRow(Table):
    """A calibration run."""

    __tablename__ = "runs"

    id: Mapped[str] = mapped_column(primary_key=True)
    state: Mapped[str]
    profile_name: Mapped[str]
    profile: Mapped[str]
    """The profile as it was when the run was created."""
    session: Mapped[str]
    """The session's folder, from the data folder."""
    owner: Mapped[str]
    note: Mapped[str]
    created_at: Mapped[datetime]
    started_at: Mapped[datetime | None]
    ended_at: Mapped[datetime | None]
    error: Mapped[str | None]
    calibration_id: Mapped[str | None] = mapped_column(ForeignKey("calibrations.id"))


class AnswerRow(Table):
    """What a request with an idempotency key was answered; without a status, it was not answered yet."""

    __tablename__ = "answers"

    key: Mapped[str] = mapped_column(primary_key=True)
    fingerprint: Mapped[str]
    """A hash of what tells the request from others."""
    asked_at: Mapped[datetime]
    status: Mapped[int | None]
    media_type: Mapped[str | None]
    body: Mapped[bytes | None]
    location: Mapped[str | None]


class CalibrationRow(Table):
    """A calibration; its document is never changed."""

    __tablename__ = "calibrations"
    __table_args__ = (Index("one_active_calibration", "active", unique=True, sqlite_where=text("active")),)

    id: Mapped[str] = mapped_column(primary_key=True)
    created_at: Mapped[datetime]
    method: Mapped[str]
    document: Mapped[str]
    verification: Mapped[str | None]
    """What the held-out views said, as JSON."""
    active: Mapped[bool]
    run_id: Mapped[str | None]
    checksum: Mapped[str | None]
    """The document's SHA-256, in hexadecimal digits; None where it was stored by an activecam that kept none."""


class ApiKeyRow(Table):
    """An API key, of which the hash alone is kept."""

    __tablename__ = "api_keys"

    name: Mapped[str] = mapped_column(primary_key=True)
    role: Mapped[str]
    digest: Mapped[str] = mapped_column(unique=True)
    created_at: Mapped[datetime]
    last_used_at: Mapped[datetime | None]


class AuditRow(Table):
    """What somebody did."""

    __tablename__ = "audit"

    id: Mapped[int] = mapped_column(primary_key=True)
    time: Mapped[datetime]
    who: Mapped[str | None]
    role: Mapped[str]
    address: Mapped[str]
    method: Mapped[str]
    path: Mapped[str]
    asked: Mapped[str]
    status: Mapped[int | None]
    code: Mapped[str | None]
