"""A server in a process of its own, for as long as it is measured."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

GRACE = 20.0
"""Seconds that a server may take to end before it is killed."""


@contextmanager
def server_process(module: str, argument: str) -> Iterator[str]:
    """Give the address that `python -m module argument` prints when it is ready; it is ended on leaving."""
    command = [sys.executable, "-m", module, argument]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            if not address:
                raise RuntimeError(f"{module} did not start: its own message says why")
            yield address
        finally:
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(GRACE)
            except subprocess.TimeoutExpired:
                process.kill()
