"""The values of a drive's object dictionary, read and written by SDO, in the link's thread."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import canopen
from canopen.sdo import SdoAbortedError, SdoCommunicationError
from canopen.sdo.constants import ABORT_NO_SUBINDEX, ABORT_NOT_IN_OD

from drivers.cia402.objects import Entry
from drivers.errors import DeviceFaultError, DeviceLostError, OptionsError

T = TypeVar("T")

STALE_ANSWERS = 2
"""Exchanges in which a late drive's answer to an earlier request may come first."""


class Values:
    """What a node keeps, by its entries.

    Every method raises DeviceLostError where the node does not answer, DeviceFaultError where it refuses.
    """

    def __init__(self, name: str, node: canopen.RemoteNode) -> None:
        """`name` is the drive's in messages."""
        self._name = name
        self._node = node

    def read(self, entry: Entry) -> int:
        """Read a value."""
        with self.answering(f"to tell its object {entry}"):
            return _exchanged(lambda: int(self._variable(entry).raw))

    def read_if_there(self, entry: Entry) -> int | None:
        """Read a value that a drive may do without."""
        with self.answering(f"to tell its object {entry}"):
            try:
                return _exchanged(lambda: int(self._variable(entry).raw))
            except SdoAbortedError as error:
                if error.code in {ABORT_NOT_IN_OD, ABORT_NO_SUBINDEX}:
                    return None
                raise

    def write(self, entry: Entry, value: int) -> None:
        """Write a value."""
        with self.answering(f"{value} for its object {entry}"):
            _exchanged(lambda: setattr(self._variable(entry), "raw", value))

    def write_if_there(self, entry: Entry, value: int) -> bool:
        """Write a value that a drive may do without; return whether it has it."""
        if self.read_if_there(entry) is None:
            return False
        self.write(entry, value)
        return True

    def write_and_check(self, entry: Entry, value: int) -> None:
        """Write a value and read it back. Raises OptionsError where the drive made another one of it."""
        self.write(entry, value)
        kept = self.read(entry)
        if kept != value:
            raise OptionsError(
                f"{self._name} keeps {kept} in its object {entry} where {value} was written: "
                "the profile asks for more than its own limits allow"
            )

    @contextmanager
    def answering(self, what: str) -> Iterator[None]:
        """Say in words what goes wrong inside, where the drive is asked `what`."""
        try:
            yield
        except SdoAbortedError as error:
            raise DeviceFaultError(f"{self._name} refuses {what}: {error}") from error
        except SdoCommunicationError as error:
            raise DeviceLostError(
                f"{self._name} does not answer: check its power, its cable, its node number and the bit rate"
            ) from error

    def _variable(self, entry: Entry) -> Any:
        item = self._node.sdo[entry.index]
        return item[entry.subindex] if entry.subindex else item


def _exchanged(exchange: Callable[[], T]) -> T:
    """Ask or tell once more where the answer is another request's: what `canopen` asks twice is answered twice.

    No motion is begun by SDO.
    """
    for _ in range(STALE_ANSWERS):
        try:
            return exchange()
        except SdoCommunicationError as error:
            if "No SDO response" in str(error):
                raise
    return exchange()
