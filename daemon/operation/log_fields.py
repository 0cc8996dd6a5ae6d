"""What records of the log are about: fields that hold for all that is logged in a block, by whomever."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from types import MappingProxyType

_FIELDS: ContextVar[Mapping[str, str]] = ContextVar("log_fields", default=MappingProxyType({}))


@contextmanager
def log_fields(**fields: str) -> Generator[None]:
    """Let every record that is logged in this block have `fields`, those of tasks that it begins included."""
    token = _FIELDS.set({**_FIELDS.get(), **fields})
    try:
        yield
    finally:
        _FIELDS.reset(token)


def fields_now() -> Mapping[str, str]:
    """Return the fields of a record that is logged here."""
    return _FIELDS.get()
