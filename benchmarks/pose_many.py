"""Time to the last byte of ten thousand poses with covariance in one `POST /pose`, over that of reading them.

The daemon serves the paper's simulated table from a process of its own. What the same answer takes Python's own
`json` to read stands beside it: the least that most clients spend on it.
"""

import asyncio
import json
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.http_client import request
from benchmarks.paper_rig import PAN_DEG, SLIDE_MM
from benchmarks.pose_rate import connect
from benchmarks.pose_server import POSE
from benchmarks.printing import console, say, spread_cells, table
from benchmarks.server_process import server_process
from benchmarks.timing import Pairs, Spread, seconds

LIMIT = 0.5
"""Seconds that ten thousand poses may take."""


def run(*, quick: bool) -> dict[str, float]:
    """Print the table; return the median (s) and the ratio."""
    count, rounds = (100, 2) if quick else (10_000, 7)
    with (
        TemporaryDirectory() as folder,
        server_process("benchmarks.pose_server", str(Path(folder))) as address,
    ):
        size, pairs = asyncio.run(_measure(address, count, rounds))
    answered = Spread.of(pairs.a)
    rows = table(f"{count} poses, {size / 1e6:.1f} MB", "", "s", "min..max")
    rows.add_row("POST /pose to the last byte", *spread_cells(answered, 3))
    rows.add_row("read by json", *spread_cells(Spread.of(pairs.b), 3))
    rows.add_row("ratio", *spread_cells(pairs.ratio, 2))
    console.print(rows)
    say(f"ten thousand poses should take less than {LIMIT:g} s")
    return {"answered (s)": answered.median, "answered / read": pairs.ratio.median}


async def _measure(address: str, count: int, rounds: int) -> tuple[int, Pairs]:
    """Return the bytes of an answer, and the times (s) to get it and to read it."""
    low, high = np.transpose([SLIDE_MM, PAN_DEG])
    readings = np.random.default_rng(0).uniform(low, high, (count, 2)).tolist()
    wire = request("POST", POSE, json.dumps({"readings": readings}).encode())
    (connection,) = await connect(address, 1)
    times: Pairs = Pairs([], [])
    for index in range(rounds + 1):
        begin = time.perf_counter()
        await connection.repeat(wire, 1)
        answered = time.perf_counter() - begin
        read = seconds(lambda: json.loads(connection.body))
        if index:  # the first one warms up
            times.a.append(answered)
            times.b.append(read)
    poses = json.loads(connection.body)["poses"]
    if len(poses) != count or any(pose["covariance"] is None for pose in poses):
        raise RuntimeError("the answer lacks poses, or their covariances")
    connection.close()
    return len(connection.body), times
