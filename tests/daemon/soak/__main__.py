"""`python -m tests.daemon.soak MINUTES [SEED]`: exit status 1 where something has grown."""

import asyncio
import json
import random
import sys
import tempfile
import time
from asyncio.subprocess import PIPE, Process
from typing import Any

from tests.daemon.soak.clients import Crowd
from tests.daemon.soak.verdict import COUNTS, complaints, growth

WARM_UP = 0.15
"""The part of the time after which the figures count: caches are full then, and threads begun."""
PATIENCE = 30.0
"""Seconds in which nothing is left of clients that have gone."""


async def ask(daemon: Process) -> dict[str, Any]:
    """Return what the daemon takes now."""
    assert daemon.stdin is not None
    daemon.stdin.write(b"\n")
    return await told(daemon)


async def told(daemon: Process) -> dict[str, Any]:
    assert daemon.stdout is not None
    return dict(json.loads(await daemon.stdout.readline()))


async def alone(daemon: Process, at_most: dict[str, Any] | None = None) -> dict[str, Any]:
    """Return what the daemon takes once no client is left, and no more than `at_most` where that comes in time."""
    until = time.monotonic() + PATIENCE
    while True:
        await asyncio.sleep(1)
        now = await ask(daemon)
        back = not now["streams"] if at_most is None else all(now[name] <= at_most[name] for name in COUNTS)
        if back or time.monotonic() > until:
            return now


async def stop_runs(crowd: Crowd) -> None:
    await crowd.http.post("/stop")
    await crowd.http.post("/stop/acknowledge")
    await crowd.http.aclose()


async def soak(minutes: float, seed: int) -> list[str]:
    """Let clients come and go for `minutes`, and return what has grown."""
    with tempfile.TemporaryDirectory() as folder:
        module = (sys.executable, "-m", "tests.daemon.soak.daemon", folder)
        daemon = await asyncio.create_subprocess_exec(*module, stdin=PIPE, stdout=PIPE)
        address = (await told(daemon))["address"]
        rng = random.Random(seed)

        warming = Crowd(address, rng)
        async with warming.present():
            await asyncio.sleep(60 * minutes * WARM_UP)
        await stop_runs(warming)
        before = await alone(daemon)

        crowd, began = Crowd(address, rng), time.monotonic()
        times, rss = [], []
        async with crowd.present():
            while (passed := (time.monotonic() - began) / 60) < minutes * (1 - WARM_UP):
                await asyncio.sleep(min(60.0, 60 * minutes / 15))
                now = await ask(daemon)
                times.append(passed)
                rss.append(now["rss_mib"])
                counts = ", ".join(f"{now[name]} {name}" for name in COUNTS)
                did = f"{sum(crowd.runs.values())} runs, {crowd.poses} poses, {crowd.visits} visits"
                print(f"{passed:5.1f} min: {now['rss_mib']:6.1f} MiB, {counts}; {did}", flush=True)
        await stop_runs(crowd)
        after = await alone(daemon, before)

        assert daemon.stdin is not None
        daemon.stdin.close()
        ended = await daemon.wait()
    print(f"runs: {crowd.runs}")
    print(f"memory: {growth(times, rss):+.1f} MiB by the line through {len(times)} samples")
    for name in COUNTS:
        print(f"{name}: {before[name]} before, {after[name]} after")
    return complaints(times, rss, before, after) + ([f"the daemon ended with {ended}"] if ended else [])


def main() -> None:
    minutes = float(sys.argv[1])
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    found = asyncio.run(soak(minutes, seed))
    print("\n".join(found) or "nothing has grown")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
