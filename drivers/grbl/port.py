"""A serial port: one thread opens, reads and closes it; what is written goes out at once."""

import asyncio
import contextlib
import errno
import termios
import threading
from collections.abc import Callable
from typing import Any, Final

import serial

from drivers.cancellation import finish
from drivers.errors import DeviceLostError

READ_WAIT: Final = 0.5
"""Seconds after which the thread looks whether it is still wanted."""

# What pyserial lets through when a device goes, beside its own exceptions, which are OSErrors: termios.error,
# and a TypeError where the port was closed under a blocked read.
GONE: Final = (OSError, termios.error, TypeError)


class SerialPort:
    """One opening of a port, from `open` to `close`: nothing late of it is heard after that.

    `heard` gets what arrives and `lost` the reason when the port goes, both in the event loop.
    """

    def __init__(
        self, path: str, baud_rate: int, heard: Callable[[bytes], None], lost: Callable[[str], None]
    ) -> None:
        self._path = path
        self._baud_rate = baud_rate
        self._heard = heard
        self._lost = lost
        self._loop = asyncio.get_running_loop()
        self._opened: asyncio.Future[serial.Serial] = self._loop.create_future()
        self._closed: asyncio.Future[None] = self._loop.create_future()
        self._closing = threading.Event()
        self._port: serial.Serial | None = None

    async def open(self) -> None:
        """Open the port, for this program alone. Raises DeviceLostError with what to do."""
        threading.Thread(target=self._run, name=f"port {self._path}", daemon=True).start()
        try:
            self._port = await asyncio.shield(self._opened)
        except GONE as error:
            raise DeviceLostError(_refused(self._path, error)) from error
        except asyncio.CancelledError:
            await finish(self.close())
            self._opened.exception()  # asked for, so that asyncio does not report it as never retrieved
            raise

    def write(self, data: bytes) -> None:
        """Send `data` at once. Raises DeviceLostError."""
        if self._port is None:
            raise DeviceLostError(f"the port {self._path} is not open: open it first")
        try:
            written = self._port.write(data)
        except GONE as error:
            raise DeviceLostError(f"the port {self._path} is gone: {error}: plug it in again") from error
        if written != len(data):
            raise DeviceLostError(
                f"the port {self._path} takes nothing any more: unplug it and plug it in again"
            )

    async def close(self) -> None:
        """Let the port go, so that the device comes back under its old name when it is plugged in again."""
        port, self._port = self._port, None
        self._closing.set()
        if port is not None:
            with contextlib.suppress(*GONE):
                port.cancel_read()
        await finish(self._end())

    async def _end(self) -> None:
        await asyncio.wait([self._closed])

    def _run(self) -> None:
        port = None
        try:
            try:
                port = serial.Serial(
                    self._path, self._baud_rate, timeout=READ_WAIT, write_timeout=0, exclusive=True
                )
            except GONE as error:
                self._post(self._opened.set_exception, error)
                return
            self._post(self._opened.set_result, port)
            self._listen(port)
            self._closing.wait()
        finally:
            if port is not None:
                with contextlib.suppress(*GONE):
                    port.close()
            self._post(self._closed.set_result, None)

    def _listen(self, port: serial.Serial) -> None:
        try:
            while not self._closing.is_set():
                data = port.read(max(1, port.in_waiting))
                if data:
                    self._post(self._hear, data)
        except GONE as error:
            self._post(self._lose, str(error))

    def _hear(self, data: bytes) -> None:
        if not self._closing.is_set():
            self._heard(data)

    def _lose(self, reason: str) -> None:
        if not self._closing.is_set():
            self._lost(f"the port {self._path} is gone ({reason}): plug it in again")

    def _post(self, act: Callable[..., Any], argument: Any) -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed: nobody listens any more
            self._loop.call_soon_threadsafe(act, argument)


def _refused(path: str, error: BaseException) -> str:
    match getattr(error, "errno", None):
        case errno.ENOENT | errno.ENODEV | errno.ENXIO:
            return f"there is no port {path}: plug the controller in, and see its name in /dev/serial/by-id"
        case errno.EACCES | errno.EPERM:
            return f"the port {path} may not be opened: add yourself to its group (often 'dialout')"
        case errno.EAGAIN | errno.EBUSY:
            return f"another program has the port {path} open: close that program"
    return f"the port {path} cannot be opened: {error}"
