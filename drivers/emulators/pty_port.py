"""A pseudo-terminal in the place of a serial port, which can be unplugged and come back under another name."""

import asyncio
import contextlib
import errno
import os
import select
import tty
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

_LOOK: Final = 0.01
"""Seconds between two looks at whether somebody has opened the port."""
_CHUNK: Final = 4096


class PtyPort:
    """A port at `path`, a link as in /dev/serial/by-id that stays the same while the device's own name changes.

    `heard` is called with what arrives, `opened` whenever a program opens the port, as a device sees it by
    the line DTR. Both are called by the event loop that `plug` was called in.
    """

    def __init__(self, name: str, heard: Callable[[bytes], None], opened: Callable[[], None]) -> None:
        self._folder = TemporaryDirectory(prefix="activecam-")
        self.path = Path(self._folder.name) / name
        self._heard = heard
        self._opened = opened
        self._master: int | None = None
        self._listening = False
        self._look: asyncio.TimerHandle | None = None

    @property
    def device(self) -> str | None:
        """The name of the device, such as /dev/pts/3; None while it is unplugged."""
        return None if self._master is None else str(self.path.readlink())

    def plug(self) -> None:
        """Appear, under a name of the system's choice."""
        if self._master is not None:
            return
        self._master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(slave))
        os.close(slave)  # from here on the master can tell whether anybody has the port open
        self._wait_for_opening()

    def unplug(self) -> None:
        """Be gone: whoever has the port open gets errors."""
        master, self._master = self._master, None
        if master is None:
            return
        loop = asyncio.get_running_loop()
        if self._look is not None:
            self._look.cancel()
        loop.remove_reader(master)
        self._listening = False
        self.path.unlink(missing_ok=True)
        os.close(master)

    def close(self) -> None:
        """Unplug for good."""
        self.unplug()
        self._folder.cleanup()

    def send(self, data: bytes) -> None:
        """Send what somebody may read; lost where nobody has the port open, or reads."""
        if self._master is not None and self._listening:
            with contextlib.suppress(OSError):
                os.write(self._master, data)

    def _wait_for_opening(self) -> None:
        assert self._master is not None
        poll = select.poll()
        poll.register(self._master, select.POLLIN)
        if any(event & select.POLLHUP for _, event in poll.poll(0)):
            self._look = asyncio.get_running_loop().call_later(_LOOK, self._wait_for_opening)
            return
        self._listening = True
        self._opened()
        asyncio.get_running_loop().add_reader(self._master, self._read)

    def _read(self) -> None:
        assert self._master is not None
        try:
            data = os.read(self._master, _CHUNK)
        except BlockingIOError:
            return
        except OSError as error:
            if error.errno != errno.EIO:  # which says that nobody has it open any more
                raise
            asyncio.get_running_loop().remove_reader(self._master)
            self._listening = False
            self._wait_for_opening()
            return
        self._heard(data)
