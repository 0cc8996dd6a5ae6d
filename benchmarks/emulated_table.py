"""The emulated devices of `stop_under_load`, in a process of their own: the shipped stepper table and its camera.

`python -m benchmarks.emulated_table FOLDER` writes the profile to serve into FOLDER, prints its path, and then the time
(monotonic clock, s) of each byte on the controller's wire that stops it.
"""

import asyncio
import signal
import sys
import time
from pathlib import Path
from typing import Final

from daemon.emulation import emulated
from daemon.profile import load_profile
from daemon.profile.source import read_profile
from drivers.emulators.grbl import GrblEmulator

PROFILE: Final = "grbl-table"
STOPS: Final = b"\x85\x18!"
"""Jog cancel, reset and feed hold."""


async def main(folder: Path) -> None:
    """Emulate until SIGTERM."""
    ended = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, ended.set)
    async with emulated(load_profile(PROFILE)) as rig:
        for emulator in rig.emulators.values():
            if isinstance(emulator, GrblEmulator):
                _tell_stops(emulator)
        served = folder / "served.toml"
        served.write_text(rig.profile_to_serve(read_profile(PROFILE).text), encoding="utf-8")
        print(served, flush=True)
        await ended.wait()


def _tell_stops(emulator: GrblEmulator) -> None:
    receive = emulator.firmware.receive

    def received(data: bytes) -> None:
        at = time.monotonic()
        receive(data)
        if any(byte in STOPS for byte in data):
            print(at, flush=True)

    emulator.firmware.receive = received  # type: ignore[method-assign]


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1])))
