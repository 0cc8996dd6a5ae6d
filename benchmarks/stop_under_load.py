"""Time from the request of a stop over HTTP to the stopping byte on the controller's wire, idle and while all goes on.

The daemon serves the emulated stepper table, both in processes of their own; the emulator says when each byte came in.
Under load, a run has just been started, four clients look at the live picture, and one asks for the pose all the time.
"""

import asyncio
import contextlib
import json
import multiprocessing
import queue
import random
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import quantiles
from tempfile import TemporaryDirectory
from typing import Final
from urllib.parse import urlsplit

from benchmarks.http_client import Connection, request, send
from benchmarks.pose_rate import connect, home
from benchmarks.pose_server import POSE
from benchmarks.printing import console, say, spread_cells, table
from benchmarks.server_process import server_process
from benchmarks.timing import Spread

LIMIT: Final = 20.0
"""Milliseconds that 99 of 100 stops may take to the wire."""
VIDEO_CLIENTS: Final = 4
LONGEST_DELAY: Final = 3.0
"""Seconds into a run within which it is stopped, at random: in a move, while it settles, or in a detection."""


def run(*, quick: bool) -> dict[str, float]:
    """Print the table; return the medians and the slowest in a hundred (ms)."""
    stops = 2 if quick else 40
    with (
        TemporaryDirectory() as folder,
        _emulators(Path(folder)) as (profile, told),
        server_process("benchmarks.table_server", profile) as address,
    ):
        idle, loaded = asyncio.run(_measure(address, told, stops))
    rows = table("From POST /stop to the byte on the wire (ms)", "", "median", "min..max", "p99")
    figures = {}
    for name, times in (("idle", idle), ("under load", loaded)):
        slowest = quantiles(times, n=100, method="inclusive")[98]
        rows.add_row(name, *spread_cells(Spread.of(times), 2), f"{slowest:.2f}")
        figures |= {f"{name}, median": Spread.of(times).median, f"{name}, p99": slowest}
    console.print(rows)
    say(f"{stops} stops each; 99 of 100 should take less than {LIMIT:g} ms under load")
    return figures


@contextlib.contextmanager
def _emulators(folder: Path) -> Iterator[tuple[str, "queue.Queue[float]"]]:
    """Give the profile to serve, and the times (s) of stopping bytes as they come."""
    command = [sys.executable, "-m", "benchmarks.emulated_table", str(folder)]
    told: queue.Queue[float] = queue.Queue()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        lines = process.stdout
        try:
            profile = lines.readline().strip()
            listening = threading.Thread(target=lambda: [told.put(float(line)) for line in lines])
            listening.start()
            yield profile, told
        finally:
            process.terminate()
    listening.join()


async def _measure(address: str, told: "queue.Queue[float]", stops: int) -> tuple[list[float], list[float]]:
    """Return the times (ms) of stops of an idle rig, and of runs under load."""
    (connection,) = await connect(address, 1)
    await home(connection)
    delays = random.Random(0)
    idle = [await _stop(connection, told) for _ in range(stops)]
    loaded = []
    with _load(address):
        for _ in range(stops):
            run = json.loads(await send(connection, "POST", "/api/v1/runs", b"{}"))["id"]
            await asyncio.sleep(delays.uniform(0.2, LONGEST_DELAY))
            loaded.append(await _stop(connection, told))
            await _over(connection, run)
    connection.close()
    return idle, loaded


async def _over(connection: Connection, run: str) -> None:
    while True:
        if json.loads(await send(connection, "GET", f"/api/v1/runs/{run}"))["ended_at"] is not None:
            return
        await asyncio.sleep(0.02)


async def _stop(connection: Connection, told: "queue.Queue[float]") -> float:
    """Stop everything, and return how long (ms) that took to the wire."""
    while not told.empty():
        told.get()
    asked = time.monotonic()
    await send(connection, "POST", "/api/v1/stop")
    reached = await asyncio.to_thread(told.get, True, 60.0)
    await send(connection, "POST", "/api/v1/stop/acknowledge")
    return 1e3 * (reached - asked)


@contextlib.contextmanager
def _load(address: str) -> Iterator[None]:
    clients = multiprocessing.get_context("spawn").Process(target=_look, args=(address,), daemon=True)
    clients.start()
    try:
        yield
    finally:
        clients.terminate()
        clients.join()


def _look(address: str) -> None:
    asyncio.run(_look_and_ask(address))


async def _look_and_ask(address: str) -> None:
    where, video = urlsplit(address), []
    for _ in range(VIDEO_CLIENTS):
        reader, writer = await asyncio.open_connection(where.hostname, where.port)
        writer.write(request("GET", "/api/v1/camera/stream.mjpg"))
        video.append(asyncio.create_task(_watch(reader)))
    (asking,) = await connect(address, 1)
    while True:
        await asking.repeat(request("GET", POSE), 1000)


async def _watch(reader: asyncio.StreamReader) -> None:
    while await reader.read(1 << 16):
        pass
