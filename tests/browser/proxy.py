"""A proxy that serves a daemon under a path of its own, as one in a laboratory's network does."""

import asyncio
import contextlib
import threading
from collections.abc import Iterator
from urllib.parse import urlsplit

PATH = b"/lab/rig-1"


@contextlib.contextmanager
def proxied(address: str) -> Iterator[str]:
    """Give the address at which what is at `address` is served as well."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    try:
        server = asyncio.run_coroutine_threadsafe(_serve(address), loop).result(60)
        port = server.sockets[0].getsockname()[1]
        try:
            yield f"http://127.0.0.1:{port}{PATH.decode()}/"
        finally:
            asyncio.run_coroutine_threadsafe(_end(server), loop).result(60)
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


async def _serve(address: str) -> asyncio.Server:
    where = urlsplit(address)

    async def pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(asyncio.IncompleteReadError, OSError), contextlib.closing(writer):
            head = await reader.readuntil(b"\r\n\r\n")
            method, path, rest = head.split(b" ", 2)
            if not path.startswith(PATH + b"/"):
                writer.write(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
            else:
                if b"upgrade: websocket" not in rest.lower():
                    rest = rest.replace(b"Connection: keep-alive", b"Connection: close")  # a request each
                far, near = await asyncio.open_connection(where.hostname, where.port)
                near.write(b" ".join([method, path.removeprefix(PATH), rest]))
                with contextlib.closing(near):
                    await asyncio.gather(_copy(reader, near), _copy(far, writer))

    return await asyncio.start_server(pass_on, "127.0.0.1", 0)


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while data := await reader.read(1 << 16):
        writer.write(data)
        await writer.drain()
    writer.close()


async def _end(server: asyncio.Server) -> None:
    server.close()
    tasks = asyncio.all_tasks() - {asyncio.current_task()}
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    await asyncio.sleep(0)  # in which what they have closed is
