"""A daemon in a process of its own, as its users start it."""

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ACTIVECAM = (sys.executable, "-c", "from daemon.cli import main; main()")


@dataclass
class Daemon:
    """Where it is reached, and, once it is over, what it has logged."""

    address: str
    log: str = ""


@contextmanager
def daemon_process(profile: Path, data: Path, *options: str) -> Iterator[Daemon]:
    """Run `activecam serve` at a free port; it ends as its user would end it, and in order."""
    serve = [*ACTIVECAM, "serve", "--port", "0", "--profile", str(profile), "--data", str(data), *options]
    with subprocess.Popen(
        serve, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=profile.parent
    ) as process:
        assert process.stdout is not None
        try:
            found = re.search(r"http://[\w.:]+", process.stdout.readline())
            assert found is not None, "it did not start"
            daemon = Daemon(found[0])
            yield daemon
        finally:
            process.terminate()
            _, log = process.communicate()
    daemon.log = log
    assert process.returncode == 0
