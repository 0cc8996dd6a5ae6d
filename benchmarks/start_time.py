"""Time from starting `activecam serve` until it is ready, over the time that importing FastAPI, numpy and OpenCV takes.

Both are processes of their own, in turns. The daemon serves the paper's simulated table, and is ready when it has
opened it and takes requests.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from benchmarks.printing import add_pairs, console, say, timing_table
from benchmarks.timing import Pairs, in_turns

LIMIT: Final = 1.5
IMPORTS: Final = "import fastapi, numpy, cv2"
SERVE: Final = ("from daemon.cli import main; main()", "serve", "--profile", "paper-table", "--port", "0")


def run(*, quick: bool) -> dict[str, float]:
    """Print the table; return the ratio."""
    say(f"Asked for: a ratio of at most {LIMIT:g}")
    times = Pairs([_start()], [_imports()]) if quick else in_turns(_start, _imports, 9)
    rows = timing_table("Seconds")
    add_pairs(rows, "exec to ready / imports", times, digits=2)
    console.print(rows)
    return {"exec to ready / imports": times.ratio.median}


def _imports() -> float:
    began = time.perf_counter()
    subprocess.run([sys.executable, "-c", IMPORTS], check=True)
    return time.perf_counter() - began


def _start() -> float:
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-c", *SERVE, "--data", str(Path(folder) / "data")]
        environment = os.environ | {"PYTHONUNBUFFERED": "1"}
        # As what is installed: compiled once, in the warm-up.
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        began = time.perf_counter()
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
        ) as daemon:
            assert daemon.stdout is not None
            said = daemon.stdout.readline()
            took = time.perf_counter() - began
            daemon.send_signal(signal.SIGTERM)
        if not said:
            raise RuntimeError("the daemon did not start: 'activecam serve --profile paper-table' says why")
    return took
