"""How `solve` grows with the views: its time and its memory from 50 to 1000 views of 200 points, on one core.

`cv2.calibrateCamera` alone runs beside it on the same views, up to the size at which it takes long. Times are the
processor's, which other work on the machine lengthens little. Each measurement is a process of its own, so that the
most memory it ever held is that of one calibration.
"""

import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Final

import cv2

from benchmarks.paper_rig import session_of_points
from benchmarks.printing import console, say, table
from benchmarks.solve_time import NOISE_PX, peer
from benchmarks.timing import threads
from calib import solve
from calib.targets import CircleGrid

VIEWS: Final = (50, 100, 200, 500, 1000)
TARGET = CircleGrid(kind="circle_grid", rows=10, columns=20, pitch=0.01, disk_diameter=0.006)
REPEATS = 3
LONG_S = 10.0
"""A peer that takes longer is not asked for more."""
KIB_A_MB = 1024.0
"""Linux counts the memory of a process in KiB."""


@dataclass(frozen=True, slots=True)
class Cost:
    """The least time of several runs, and the most memory that the process held, before them and at all."""

    seconds: float
    megabytes_before: float
    megabytes: float


def run(*, quick: bool) -> dict[str, float]:
    """Print the table; return how much a view costs in the largest session over the smallest, and the memory."""
    cv2.setNumThreads(1)
    sizes = (10, 20) if quick else VIEWS
    points = TARGET.rows * TARGET.columns
    say(f"{points} points a view, {NOISE_PX} px noise; least of {REPEATS} runs; {threads()}")
    rows = table(
        "Growth with the views",
        "views",
        "solve (s)",
        "ms a view",
        "over the smallest's",
        "memory (MB)",
        "before (MB)",
        "calibrateCamera (s)",
        "memory (MB)",
    )
    ours: list[Cost] = []
    theirs: Cost | None = Cost(0.0, 0.0, 0.0)
    for views in sizes:
        cost = _measured("solve", views)
        ours.append(cost)
        theirs = _measured("peer", views) if theirs is not None and theirs.seconds < LONG_S else None
        growth = (cost.seconds / views) / (ours[0].seconds / sizes[0])
        rows.add_row(
            str(views),
            f"{cost.seconds:.3f}",
            f"{1e3 * cost.seconds / views:.2f}",
            f"{growth:.2f}",
            f"{cost.megabytes:.0f}",
            f"{cost.megabytes_before:.0f}",
            *(("-", "-") if theirs is None else (f"{theirs.seconds:.3f}", f"{theirs.megabytes:.0f}")),
        )
    console.print(rows)
    say("Memory before is that of the program with the session read: what a calibration adds is the rest.")
    return {
        f"seconds a view, {sizes[-1]} views over {sizes[0]}": growth,
        f"seconds for {sizes[-1]} views": ours[-1].seconds,
        f"MB for {sizes[-1]} views": ours[-1].megabytes,
    }


def _measured(what: str, views: int) -> Cost:
    """Return what a calibration costs in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.solve_growth", what, str(views)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return Cost(**json.loads(done.stdout))


def _cost(what: str, views: int) -> Cost:
    """Return what a calibration costs in this process."""
    cv2.setNumThreads(1)
    session = session_of_points(views, NOISE_PX, target=TARGET)
    work = peer(session) if what == "peer" else lambda: solve(session)
    before = _peak()
    least = min(_processor_seconds(work) for _ in range(REPEATS))
    return Cost(least, before, _peak())


def _processor_seconds(work: Callable[[], object]) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


def _peak() -> float:
    """Return the most memory (MB) that this process ever held."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / KIB_A_MB


if __name__ == "__main__":
    print(json.dumps(asdict(_cost(sys.argv[1], int(sys.argv[2])))))
