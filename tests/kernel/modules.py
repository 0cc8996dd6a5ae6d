"""Kernel modules in and out, which is how devices are plugged in and unplugged here."""

import subprocess
import time


def load(module: str, *options: str) -> None:
    """Load a module, and wait until udev has named its devices."""
    run("modprobe", module, *options)
    settle()


def unload(module: str) -> None:
    """Take a module out; whoever has its devices open is given some time to let them go."""
    for _ in range(50):
        if subprocess.run(["modprobe", "-r", module], check=False).returncode == 0:
            settle()
            return
        time.sleep(0.2)
    raise AssertionError(f"{module} is still in use")


def settle() -> None:
    """Wait until udev has named all devices that have come, and unnamed those that have gone."""
    run("udevadm", "settle")


def run(*command: str) -> str:
    """Return what a command prints."""
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout
