"""Requests per second of `GET /pose` over a route of the same server that answers with a constant.

The daemon serves the paper's simulated table from a process of its own, as `activecam serve` would: homed,
calibrated, its axes polled. The constant is one of its poses. Beside both, as a limit, a bare socket that
sends as many bytes. One client asks all three in turns, over the same kept connections, on loopback.
"""

import asyncio
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory
from urllib.parse import urlsplit

from benchmarks.http_client import Batch, Connection, load, request, send
from benchmarks.pose_server import CONSTANT, POSE
from benchmarks.printing import add_pairs, console, say, table, timing_table
from benchmarks.server_process import server_process
from benchmarks.timing import Pairs

LONGEST_BATCH = 1.0
"""Seconds that a batch may take: a slow server is asked less often."""


@dataclass(frozen=True, slots=True)
class Load:
    """How many requests a batch has at most, on how many connections, and how many rounds of batches."""

    connections: int
    requests: int
    rounds: int


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Connections to a server, and what is asked on them."""

    name: str
    connections: Sequence[Connection]
    wire: bytes

    async def batch(self, connections: int, requests: int) -> Batch:
        """Ask so often, on so many of the connections."""
        return await load(self.connections[:connections], self.wire, requests)


@dataclass(frozen=True, slots=True)
class Answers:
    """The batches of each endpoint, round by round, and for which share of the time the client was busy."""

    batches: dict[str, list[Batch]]
    client_busy: float

    def rates(self, a: str, b: str) -> Pairs:
        """Return requests per second of two endpoints, pair by pair."""
        return Pairs([batch.rate for batch in self.batches[a]], [batch.rate for batch in self.batches[b]])


def run(*, quick: bool) -> dict[str, float]:
    """Print the tables; return the ratios of the rates."""
    loads = [Load(2, 20, 2)] if quick else [Load(1, 1000, 10), Load(8, 2000, 10), Load(32, 2000, 10)]
    with (
        TemporaryDirectory() as folder,
        server_process("benchmarks.pose_server", str(Path(folder))) as address,
    ):
        answers = asyncio.run(_measure(address, loads))
    return _print(loads, answers)


async def _measure(address: str, loads: Sequence[Load]) -> list[Answers]:
    """Home the rig, make the constant one of its poses, and put each load on all endpoints in turns."""
    most = max(each.connections for each in loads)
    daemon = await connect(address, most)
    try:
        await home(daemon[0])
        pose = await send(daemon[0], "GET", POSE)
        await send(daemon[0], "POST", CONSTANT, pose)
        say(f"Every answer has {len(pose)} bytes of body; each server is a process of its own.")
        with server_process("benchmarks.bare_server", str(len(pose))) as limit:
            bare = await connect(limit, most)
            endpoints = [
                Endpoint("GET /pose", daemon, request("GET", POSE)),
                Endpoint("constant", daemon, request("GET", CONSTANT)),
                Endpoint("bare socket", bare, request("GET", "/")),
            ]
            answers = [await _in_turns(endpoints, each) for each in loads]
            _close(bare)
            return answers
    finally:
        _close(daemon)


async def connect(address: str, count: int) -> list[Connection]:
    """Return so many connections to a server."""
    where = urlsplit(address)
    assert where.hostname is not None
    assert where.port is not None
    return [await Connection.open(where.hostname, where.port) for _ in range(count)]


def _close(connections: Sequence[Connection]) -> None:
    for connection in connections:
        connection.close()


async def home(connection: Connection) -> None:
    """Home all axes of the rig."""
    lease = json.loads(await send(connection, "POST", "/api/v1/lease", b'{"owner": "benchmark"}'))
    shown = [f"X-Lease: {lease['token']}"]
    rig = json.loads(await send(connection, "GET", "/api/v1/rig"))
    for axis in rig["axes"]:
        await send(connection, "POST", f"/api/v1/axes/{axis['name']}/home?wait=true", headers=shown)
    await send(connection, "DELETE", "/api/v1/lease", headers=shown)


async def _in_turns(endpoints: Sequence[Endpoint], given: Load) -> Answers:
    """Return the batches of `given`, after a warm-up of each endpoint, which also says how long it takes."""
    counts = {}
    for endpoint in endpoints:
        warm_up = await endpoint.batch(given.connections, max(given.connections, given.requests // 10))
        counts[endpoint.name] = min(given.requests, round(LONGEST_BATCH * warm_up.rate))
    batches: dict[str, list[Batch]] = {endpoint.name: [] for endpoint in endpoints}
    begin, busy = time.perf_counter(), time.process_time()
    for _ in range(given.rounds):
        for endpoint in endpoints:
            batch = await endpoint.batch(given.connections, counts[endpoint.name])
            batches[endpoint.name].append(batch)
    return Answers(batches, (time.process_time() - busy) / (time.perf_counter() - begin))


def _print(loads: Sequence[Load], answers: Sequence[Answers]) -> dict[str, float]:
    rates = timing_table("Requests per second")
    names = list(answers[0].batches)
    headings = [f"{name}, {percentile}" for name in names for percentile in ("p50", "p99")]
    latencies = table("Latency (ms)", "connections", *headings, "client busy (%)")
    figures = {}
    for given, taken in zip(loads, answers, strict=True):
        for peer in names[1:]:
            label = f"{given.connections} conn.: {names[0]} / {peer}"
            pairs = taken.rates(names[0], peer)
            add_pairs(rates, label, pairs, digits=0)
            figures[label] = pairs.ratio.median
        cells = [f"{1e3 * value:.2f}" for name in names for value in _percentiles(taken.batches[name])]
        latencies.add_row(str(given.connections), *cells, f"{100 * taken.client_busy:.0f}")
    console.print(rates)
    console.print(latencies)
    return figures


def _percentiles(batches: Sequence[Batch]) -> tuple[float, float]:
    """Return p50 and p99 of the latencies of all batches (s)."""
    latencies = [latency for batch in batches for latency in batch.latencies]
    return median(latencies), quantiles(latencies, n=100)[98]
