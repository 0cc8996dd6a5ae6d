"""A program at the other end of an emulated port, which sees every byte."""

import asyncio
import os
import tty
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager


class Terminal:
    """What has arrived, as lines, and a way to wait for more."""

    def __init__(self, file: int) -> None:
        self._file = file
        self._received = bytearray()
        self._more = asyncio.Event()

    @property
    def lines(self) -> list[str]:
        """The whole lines so far, those without a letter left out."""
        lines = self._received.decode("latin-1").split("\r\n")[:-1]
        return [line for line in lines if line]

    @property
    def received(self) -> bytes:
        return bytes(self._received)

    def send(self, data: bytes | str) -> None:
        os.write(self._file, data.encode() if isinstance(data, str) else data)

    def forget(self) -> None:
        self._received.clear()

    async def heard(self, *lines: str) -> None:
        """Wait until these lines have arrived, in this order, others between them or not."""
        async with asyncio.timeout(20):
            while not _in_order(lines, self.lines):
                self._more.clear()
                await self._more.wait()

    async def answer(self, line: str) -> str:
        """Send a line and return the ok or error that follows."""
        self.forget()
        self.send(f"{line}\n")
        return await self.ending()

    async def ending(self) -> str:
        async with asyncio.timeout(20):
            while True:
                for line in self.lines:
                    if line == "ok" or line.startswith("error:"):
                        return line
                self._more.clear()
                await self._more.wait()

    async def report(self) -> str:
        """Ask for a report and return it."""
        self.forget()
        self.send(b"?")
        async with asyncio.timeout(20):
            while not (reports := [line for line in self.lines if line.startswith("<")]):
                self._more.clear()
                await self._more.wait()
        return reports[0]

    async def state(self, wanted: str) -> str:
        """Ask until the state is `wanted`; return that report."""
        async with asyncio.timeout(20):
            while not (report := await self.report()).startswith(f"<{wanted}|"):
                pass
        return report

    def read(self) -> None:
        try:
            self._received.extend(os.read(self._file, 4096))
        except OSError:  # unplugged
            asyncio.get_running_loop().remove_reader(self._file)
        self._more.set()

    def hang_up(self) -> None:
        """Close the port; the file's number stays taken, so that it is closed but once."""
        asyncio.get_running_loop().remove_reader(self._file)
        nothing = os.open(os.devnull, os.O_RDWR)
        os.dup2(nothing, self._file)
        os.close(nothing)


@asynccontextmanager
async def terminal(path: str) -> AsyncIterator[Terminal]:
    """Open a port as a program does."""
    file = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    tty.setraw(file)
    opened = Terminal(file)
    loop = asyncio.get_running_loop()
    loop.add_reader(file, opened.read)
    try:
        yield opened
    finally:
        loop.remove_reader(file)
        os.close(file)


def _in_order(wanted: tuple[str, ...], lines: list[str]) -> bool:
    rest = iter(lines)
    return all(any(line.startswith(one) for line in rest) for one in wanted)
