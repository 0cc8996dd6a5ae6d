"""A daemon in a process of its own, that can be killed and started again under the open page."""

import re
import signal
import subprocess
import sys
from pathlib import Path

from tests.daemon.rigs import write_profile

ACTIVECAM = (sys.executable, "-c", "from daemon.cli import main; main()")


class Daemon:
    """`activecam serve` on `profile`, by default a small rig that is slow enough to be stopped on its way.

    `keys` is whether everybody is asked for one.
    """

    def __init__(self, folder: Path, profile: str | None = None, *, keys: bool = False) -> None:
        self._profile = profile or str(write_profile(folder, time_scale=1.0, velocity=20.0))
        self.data = folder / "data"
        self._keys = keys
        self._port = 0
        self._process: subprocess.Popen[str] | None = None
        self.address = ""
        self.keys: dict[str, str] = {}
        """Those that were made, by role."""

    def start(self) -> None:
        """Serve, at the address of before if there was one, and return when requests are answered."""
        command = [*ACTIVECAM, "serve", "--profile", self._profile, "--data", str(self.data)]
        command += ["--port", str(self._port), *(["--keys"] if self._keys else [])]
        self._process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        assert self._process.stdout is not None
        found = re.search(r"(http://[\w.]+:(\d+))/api", self._process.stdout.readline())
        assert found is not None, "the daemon did not start"
        self.address, self._port = f"{found[1]}/", int(found[2])

    @property
    def running(self) -> bool:
        """Whether it was started and has not ended."""
        return self._process is not None and self._process.poll() is None

    def kill(self) -> None:
        """End it as a power cut would."""
        assert self._process is not None
        self._process.kill()
        self._process.communicate()

    def stop(self) -> None:
        """End it as its user would, where it runs."""
        assert self._process is not None
        if not self.running:
            return
        self._process.send_signal(signal.SIGTERM)
        self._process.communicate()

    def make_key(self, role: str) -> None:
        """Make a key of `role`, which a daemon that runs knows of within a second."""
        command = [*ACTIVECAM, "key", "add", role, "--role", role, "--data", str(self.data)]
        made = subprocess.run(command, check=True, capture_output=True, text=True)
        self.keys[role] = made.stdout.strip()
