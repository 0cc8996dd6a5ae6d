"""What the contract's tests expect, without a test framework."""

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def refused(error: type[Exception]) -> Iterator[None]:
    """Expect what is done inside to raise `error`."""
    try:
        yield
    except error as raised:
        expect(bool(str(raised)), f"{error.__name__} says nothing: its message is what a person gets to read")
        return
    raise AssertionError(f"{error.__name__} was not raised")


def expect(fact: bool, otherwise: str) -> None:
    """Fail with the sentence `otherwise` unless `fact` holds."""
    if not fact:
        raise AssertionError(otherwise)
