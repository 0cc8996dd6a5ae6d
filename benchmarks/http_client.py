"""A client that costs little beside the server: HTTP/1.1, kept connections, one request at a time on each."""

import asyncio
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

END_OF_HEAD = b"\r\n\r\n"
LENGTH = b"content-length:"


class AnswerError(Exception):
    """The server answered with a problem, or hung up."""


@dataclass(frozen=True, slots=True)
class Batch:
    """How many requests were answered in how long, and each one's latency (s)."""

    seconds: float
    latencies: list[float]

    @property
    def rate(self) -> float:
        """Requests per second."""
        return len(self.latencies) / self.seconds


class Connection(asyncio.Protocol):
    """One connection, on which requests are sent one after the other."""

    def __init__(self) -> None:
        self._transport: asyncio.Transport
        self._received = bytearray()
        self._request, self._left, self._sent_at = b"", 0, 0.0
        self._latencies: list[float] = []
        self._done: asyncio.Future[list[float]] | None = None
        self.body = b""
        """What the latest answer carried."""

    @classmethod
    async def open(cls, host: str, port: int) -> Self:
        """Connect."""
        _, connection = await asyncio.get_running_loop().create_connection(cls, host, port)
        return connection

    async def repeat(self, request: bytes, count: int) -> list[float]:
        """Send `request` `count` times, each when the one before it is answered; return the latencies (s)."""
        if self._transport.is_closing():
            raise AnswerError("the server hung up before it was asked")
        self._request, self._left, self._latencies = request, count, []
        self._done = asyncio.get_running_loop().create_future()
        self._send()
        return await self._done

    def close(self) -> None:
        """Hang up."""
        self._transport.close()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the way to answer."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport

    def connection_lost(self, exc: Exception | None) -> None:
        """Fail the requests that nobody will answer."""
        self._fail(f"the server hung up: {exc}")

    def data_received(self, data: bytes) -> None:
        """Take up a part of an answer; at its end send the next request."""
        self._received += data
        head_end = self._received.find(END_OF_HEAD)
        if head_end < 0:
            return
        head = self._received[:head_end].lower()
        start = head.find(LENGTH)
        if not head.startswith(b"http/1.1 20"):
            self._fail(self._received.decode(errors="replace"))
            return
        length = int(head[start + len(LENGTH) :].split(b"\r\n", 1)[0]) if start >= 0 else 0
        whole = head_end + len(END_OF_HEAD) + length
        if len(self._received) < whole:
            return
        self._latencies.append(time.perf_counter() - self._sent_at)
        self.body = bytes(self._received[whole - length : whole])
        self._received.clear()
        self._left -= 1
        if self._left:
            self._send()
        elif self._done is not None:
            self._done.set_result(self._latencies)

    def _send(self) -> None:
        self._sent_at = time.perf_counter()
        self._transport.write(self._request)

    def _fail(self, reason: str) -> None:
        if self._done is not None and not self._done.done():
            self._done.set_exception(AnswerError(reason))


async def load(connections: Sequence[Connection], request: bytes, count: int) -> Batch:
    """Send `request` `count` times in all, shared out over the connections."""
    each = max(1, count // len(connections))
    begin = time.perf_counter()
    answered = await asyncio.gather(*(connection.repeat(request, each) for connection in connections))
    return Batch(time.perf_counter() - begin, [latency for one in answered for latency in one])


async def send(
    connection: Connection, method: str, path: str, body: bytes = b"", headers: Sequence[str] = ()
) -> bytes:
    """Send one request, and return the body of its answer."""
    await connection.repeat(request(method, path, body, headers), 1)
    return connection.body


def request(method: str, path: str, body: bytes = b"", headers: Sequence[str] = ()) -> bytes:
    """Return a request as it goes over the wire."""
    lines = [f"{method} {path} HTTP/1.1", "Host: 127.0.0.1", *headers]
    if body:
        lines += ["Content-Type: application/json", f"Content-Length: {len(body)}"]
    return "\r\n".join([*lines, "", ""]).encode() + body
