"""The log as lines on stderr: for people, or one JSON object each."""

import json
import logging
import sys
from datetime import UTC, datetime
from enum import StrEnum
from typing import Any, Final

from daemon.operation.log_fields import fields_now

OURS: Final = ("calib", "daemon", "drivers")


class LogFormat(StrEnum):
    """How a record is written."""

    TEXT = "text"
    JSON = "json"


class LogLevel(StrEnum):
    """From which level on records are written."""

    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


def log_to_stderr(form: LogFormat, level: LogLevel) -> None:
    """Write this program's records from `level` on, and those of libraries from info on at most.

    What libraries say for debugging has keys and tokens in it.
    """
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines() if form is LogFormat.JSON else TextLines())
    number = logging.getLevelNamesMapping()[level.name]
    logging.basicConfig(level=max(number, logging.INFO), handlers=[handler], force=True)
    for name in OURS:
        logging.getLogger(name).setLevel(number)
    # It logs addresses with their queries, and our own records say all else that it does.
    logging.getLogger("uvicorn").setLevel(max(number, logging.WARNING))


class TextLines(logging.Formatter):
    """A line a record: when, how bad, what, and in brackets what it is about; a traceback follows."""

    def format(self, record: logging.LogRecord) -> str:
        """Write a record."""
        about = " ".join(f"{name}={value}" for name, value in _fields(record).items())
        line = f"{_time(record)} {record.levelname:7} {_one_line(record.getMessage())}"
        line += f" [{about}]" if about else ""
        return f"{line}\n{self.formatException(record.exc_info)}" if record.exc_info else line


class JsonLines(logging.Formatter):
    """A JSON object a record: `time`, `level`, `logger`, `message`, what it is about, and `exception`."""

    def format(self, record: logging.LogRecord) -> str:
        """Write a record."""
        document: dict[str, Any] = {
            "time": _time(record),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        document |= {name: value for name, value in _fields(record).items() if name not in document}
        if record.exc_info:
            document["exception"] = self.formatException(record.exc_info)
        return json.dumps(document, ensure_ascii=False, default=str)


_STANDARD: Final = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "taskName"}


def _fields(record: logging.LogRecord) -> dict[str, Any]:
    """Return what the record is about: where it was logged, and its own `extra`."""
    own = {name: value for name, value in vars(record).items() if name not in _STANDARD}
    return {**fields_now(), **own}


def _time(record: logging.LogRecord) -> str:
    return (
        datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    )


def _one_line(message: str) -> str:
    """Return the message with whatever would begin a new line, or steer a terminal, escaped."""
    return (
        message
        if message.isprintable()
        else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in message)
    )
