"""Latency of `GET /pose` while a calibration run goes on in the same process, over that of an idle daemon.

The daemon serves the paper's simulated table from a process of its own: its run renders, detects and solves beside the
answers. One client asks at even intervals, before and during each of several runs.
"""

import asyncio
import json
import time
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory

from benchmarks.http_client import Connection, request, send
from benchmarks.pose_rate import connect, home
from benchmarks.pose_server import POSE
from benchmarks.printing import console, say, spread_cells, table
from benchmarks.server_process import server_process
from benchmarks.timing import Spread

INTERVAL = 0.005
"""Seconds between two requests."""
LIMIT = 3.0
"""How many times as long as idle the slowest in a hundred may take."""
OVER = frozenset({"succeeded", "failed", "cancelled", "interrupted"})


def run(*, quick: bool) -> dict[str, float]:
    """Print the table; return the ratios of the percentiles."""
    with (
        TemporaryDirectory() as folder,
        server_process("benchmarks.pose_server", str(Path(folder))) as address,
    ):
        idle, loaded = asyncio.run(
            _measure(address, rounds=1 if quick else 3, longest=1.0 if quick else 15.0)
        )
    rows = table("Latency of GET /pose (ms)", "", "idle", "min..max", "in a run", "min..max", "ratio")
    figures = {}
    for name, percent in (("p50", 50), ("p99", 99)):
        alone, beside = (
            Spread.of([_percentile(batch, percent) for batch in batches]) for batches in (idle, loaded)
        )
        figures[f"{name}: in a run / idle"] = beside.median / alone.median
        rows.add_row(
            name,
            *spread_cells(alone, 2),
            *spread_cells(beside, 2),
            f"{beside.median / alone.median:.2f}",
        )
    console.print(rows)
    say(f"p99 in a run should be at most {LIMIT:g} times that of an idle daemon")
    return figures


def _percentile(latencies: list[float], percent: int) -> float:
    """Return a percentile (ms) of latencies (s)."""
    return 1e3 * (median(latencies) if percent == 50 else quantiles(latencies, n=100)[percent - 1])


async def _measure(address: str, rounds: int, longest: float) -> tuple[list[list[float]], list[list[float]]]:
    """Return the latencies (s) before and during each run, of which no more than `longest` s are listened to."""
    (asking,) = await connect(address, 1)
    await home(asking)
    idle, loaded = [], []
    for _ in range(rounds):
        idle.append(await _paced(asking, asyncio.create_task(asyncio.sleep(min(longest, 5.0)))))
        (other,) = await connect(address, 1)
        run = json.loads(await send(other, "POST", "/api/v1/runs", b"{}"))["id"]
        loaded.append(await _paced(asking, asyncio.create_task(_end(other, run, longest))))
        other.close()
    asking.close()
    return idle, loaded


async def _paced(connection: Connection, over: asyncio.Task[None]) -> list[float]:
    """Ask at even intervals until `over` is done, and return the latencies (s)."""
    latencies: list[float] = []
    wire = request("GET", POSE)
    while not over.done() or len(latencies) < 2:
        begin = time.perf_counter()
        latencies += await connection.repeat(wire, 1)
        await asyncio.sleep(max(0.0, begin + INTERVAL - time.perf_counter()))
    await over
    return latencies


async def _end(connection: Connection, run: str, longest: float) -> None:
    """Return when the run is over, which it is at the latest after `longest` seconds."""
    begin = time.perf_counter()
    while json.loads(await send(connection, "GET", f"/api/v1/runs/{run}"))["state"] not in OVER:
        await asyncio.sleep(0.2)
        if time.perf_counter() - begin > longest:
            await send(connection, "POST", f"/api/v1/runs/{run}/cancel")
            return
