"""Time from SIGTERM to the end of the daemon with clients of all kinds connected and a run under way, over one second.

The daemon serves the paper's simulated table. The clients follow the run's events (SSE), the video (MJPEG) and the pose
(WebSocket), keep a connection open, and one reads nothing of the video that it asked for.
"""

import asyncio
import json
import os
import signal
import socket
import sys
import time
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Final
from urllib.parse import urlsplit

from websockets.asyncio.client import connect

from benchmarks.http_client import Connection, send
from benchmarks.printing import console, say, spread_cells, table
from benchmarks.timing import Spread

LIMIT: Final = 1.0
"""Seconds."""
API: Final = "/api/v1"
SERVE: Final = ("from daemon.cli import main; main()", "serve", "--profile", "paper-table", "--port", "0")


def run(*, quick: bool) -> dict[str, float]:
    """Print the table; return the ratio."""
    times = [asyncio.run(_measure()) for _ in range(1 if quick else 10)]
    rows = table("From SIGTERM to the end (s)", "median", "min..max")
    rows.add_row(*spread_cells(Spread.of(times), 3))
    console.print(rows)
    say(f"Asked for: less than {LIMIT:g} s")
    return {"shutdown / 1 s": median(times) / LIMIT}


async def _measure() -> float:
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-c", *SERVE, "--data", str(Path(folder) / "data")]
        daemon = await asyncio.create_subprocess_exec(
            *command,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            env=os.environ | {"PYTHONUNBUFFERED": "1"},
        )
        assert daemon.stdout is not None
        said = (await daemon.stdout.readline()).decode()
        if " at http" not in said:
            raise RuntimeError("the daemon did not start: 'activecam serve --profile paper-table' says why")
        address = urlsplit(said.partition(" at ")[2].split()[0])
        assert address.hostname is not None
        assert address.port is not None
        async with _clients(address.hostname, address.port):
            began = time.perf_counter()
            daemon.send_signal(signal.SIGTERM)
            await daemon.wait()
            return time.perf_counter() - began


@asynccontextmanager
async def _clients(host: str, port: int) -> AsyncIterator[None]:
    """Start a run, and have all kinds of clients connected that have had their first answers."""
    async with AsyncExitStack() as connected:
        kept = await Connection.open(host, port)
        connected.callback(kept.close)
        started = json.loads(await send(kept, "POST", f"{API}/runs", b"{}"))
        for path in (f"/runs/{started['id']}/events", "/camera/stream.mjpg?fps=60"):
            reader, writer = await asyncio.open_connection(host, port)
            connected.callback(writer.close)
            writer.write(f"GET {API}{path} HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
            await reader.readuntil(b"\r\n\r\n")
            reading = asyncio.create_task(_read(reader))
            connected.callback(reading.cancel)
        pose = await connected.enter_async_context(connect(f"ws://{host}:{port}{API}/pose/stream"))
        await pose.recv()
        slow = connected.enter_context(socket.socket())
        slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
        slow.connect((host, port))
        slow.sendall(f"GET {API}/camera/stream.mjpg?fps=60 HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
        await asyncio.sleep(1.0)  # the run is in its first motions, and the slow reader's buffers are full
        yield


async def _read(reader: asyncio.StreamReader) -> None:
    while await reader.read(65536):
        pass
