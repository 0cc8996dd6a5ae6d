"""A port that is open or lost, and the whole lines that come in by it."""

import asyncio
import contextlib
from collections.abc import Callable
from typing import Final

from drivers.errors import DeviceLostError, DriverError
from drivers.grbl.options import GrblOptions
from drivers.grbl.port import SerialPort

JOG_CANCEL: Final = b"\x85"
_LONGEST: Final = 1024
"""Bytes without an end of line after which they are noise."""


class Wire:
    """The wire to one controller; it can be opened again after it was lost or closed.

    `take` is called with each line, `lost` with the error that everybody who waits for one is to get.
    """

    def __init__(
        self, options: GrblOptions, take: Callable[[str], None], lost: Callable[[DeviceLostError], None]
    ) -> None:
        self.farewell = JOG_CANCEL
        """What is sent when it is given up, in case that the controller still listens."""
        self.anything_heard = False
        """Whether anything has come in since it was opened, noise or not."""
        self._options = options
        self._take = take
        self._tell = lost
        self._port: SerialPort | None = None
        self._closed = self._reason = f"the controller at {options.port} is not open: open it first"
        self._release: asyncio.Task[None] | None = None
        """Closes a port that was lost."""
        self._unread = bytearray()

    async def open(self) -> None:
        """Open the port, when an earlier one is closed. Raises DeviceLostError."""
        await self.close()
        port = SerialPort(self._options.port, self._options.baud_rate, self._hear, self.lose)
        await port.open()
        self._port, self.anything_heard = port, False
        self._unread.clear()

    async def close(self) -> None:
        """Let the port go."""
        self.lose(self._closed)
        if self._release is not None:
            await asyncio.wait([self._release])

    def write(self, data: bytes) -> None:
        """Send `data` at once. Raises DeviceLostError."""
        self.require_open()
        assert self._port is not None
        try:
            self._port.write(data)
        except DeviceLostError as error:
            self.lose(str(error))
            raise

    def try_to_write(self, data: bytes) -> None:
        """Send `data` if that can be done."""
        with contextlib.suppress(DriverError):
            self.write(data)

    def lose(self, reason: str) -> None:
        """Believe nothing any more that comes."""
        port, self._port = self._port, None
        if port is None:
            return
        self._reason = reason
        with contextlib.suppress(DriverError):
            port.write(self.farewell)
        self._release = asyncio.ensure_future(port.close())
        self._tell(DeviceLostError(reason))

    def require_open(self) -> None:
        """Raise DeviceLostError with the reason where it is not open."""
        if self._port is None:
            raise DeviceLostError(self._reason)

    def _hear(self, data: bytes) -> None:
        self.anything_heard = True
        self._unread.extend(data)
        *lines, rest = self._unread.split(b"\n")
        self._unread[:] = rest if len(rest) < _LONGEST else b""
        for line in lines:
            self._take(line.decode("ascii", "replace").strip())
