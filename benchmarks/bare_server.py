"""The limit of `pose_rate`: a socket that answers every request with the same bytes, without reading them.

`python -m benchmarks.bare_server BYTES` prints its address, and serves until SIGTERM. Faster than this no
server of the same event loop can be, and no figure of `pose_rate` that comes near it says anything but that
the client is at its end.
"""

import asyncio
import signal
import sys

HEAD = b"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: %d\r\n\r\n"


class Constant(asyncio.Protocol):
    """A connection on which each request fits into one packet."""

    def __init__(self, answer: bytes) -> None:
        self._answer = answer
        self._transport: asyncio.WriteTransport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the way to answer."""
        assert isinstance(transport, asyncio.WriteTransport)
        self._transport = transport

    def data_received(self, data: bytes) -> None:  # noqa: ARG002 whatever it says
        """Answer."""
        self._transport.write(self._answer)


async def serve(size: int) -> None:
    """Serve `size` bytes of body on loopback."""
    loop, ended = asyncio.get_running_loop(), asyncio.Event()
    loop.add_signal_handler(signal.SIGTERM, ended.set)
    answer = HEAD % size + b" " * size
    server = await loop.create_server(lambda: Constant(answer), "127.0.0.1", 0)
    print("http://{}:{}".format(*server.sockets[0].getsockname()), flush=True)
    await ended.wait()


if __name__ == "__main__":
    asyncio.run(serve(int(sys.argv[1])))
