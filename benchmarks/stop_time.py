"""Time from the call of a stop until the motor brakes, over the emulated devices, idle and beside other programs.

The axis is in full motion. A program for each processor that does nothing but compute is the load.
"""

import asyncio
import contextlib
import multiprocessing
import os
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from benchmarks.printing import console, say, spread_cells, table
from benchmarks.timing import Spread
from daemon.emulation import EmulatedRig, emulated
from daemon.profile import Profile, load_profile
from daemon.profile.source import read_profile
from daemon.rig import make_devices
from drivers.axis import Axis
from drivers.errors import MotionStoppedError
from drivers.simulated.shaft import Shaft

RIGS: Final = ("grbl-table", "cia402-pan-tilt")
LIMIT: Final = 50.0
"""Milliseconds that a stop may take to reach its device."""
RAMP: Final = 0.3
"""Seconds after which an axis is in full motion."""


def run(*, quick: bool) -> dict[str, float]:
    """Print the table; return the medians (ms)."""
    stops = 2 if quick else 30
    say(f"{stops} stops each of a rig's first axis; none should take longer than {LIMIT:g} ms")
    rows = table("From a stop to the braking motor (ms)", "rig", "idle", "min..max", "under load", "min..max")
    figures = {}
    for name in RIGS:
        idle, loaded = asyncio.run(_measure(name, stops))
        rows.add_row(name, *spread_cells(idle, 2), *spread_cells(loaded, 2))
        figures |= {f"{name}, idle": idle.median, f"{name}, under load": loaded.median}
    console.print(rows)
    return figures


async def _measure(name: str, stops: int) -> tuple[Spread, Spread]:
    async with emulated(load_profile(name)) as rig:
        devices = make_devices(_served(name, rig))
        axis_name, axis = next(iter(next(iter(devices.controllers.values())).axes.items()))
        shaft = rig.world.shaft(axis_name)[1]
        async with contextlib.AsyncExitStack() as opened:
            for controller in devices.controllers.values():
                await controller.open()
                opened.push_async_callback(controller.close)
            await axis.home()
            idle = [await _stop(axis, shaft) for _ in range(stops)]
            with _load():
                loaded = [await _stop(axis, shaft) for _ in range(stops)]
    return Spread.of(idle), Spread.of(loaded)


def _served(name: str, rig: EmulatedRig) -> Profile:
    """Return the profile that has the emulators in it."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "served.toml"
        file.write_text(rig.profile_to_serve(read_profile(name).text), encoding="utf-8")
        return load_profile(file)


async def _stop(axis: Axis, shaft: Shaft) -> float:
    """Send the axis to its farther end, stop it on its way, and return the time (ms) until it braked."""
    low, high = axis.spec.limits
    position = (await axis.read()).require_homed(axis.spec)
    motion = asyncio.ensure_future(axis.move(low if position > (low + high) / 2 else high))
    while not (await axis.read()).moving:
        pass  # a driver asks its device no more often than it should
    await asyncio.sleep(RAMP)
    moving = shaft.motion
    called = asyncio.get_running_loop().time()  # the monotonic clock, as the world's
    await axis.stop()
    with contextlib.suppress(MotionStoppedError):
        await motion
    if shaft.motion is moving:
        raise RuntimeError(f"axis '{axis.spec.name}' was at its end before it was stopped")
    return 1e3 * (shaft.motion.began - called)


@contextlib.contextmanager
def _load() -> Iterator[None]:
    spinning = [multiprocessing.Process(target=_spin, daemon=True) for _ in range(os.cpu_count() or 1)]
    for process in spinning:
        process.start()
    try:
        yield
    finally:
        for process in spinning:
            process.terminate()
            process.join()


def _spin() -> None:
    while True:
        pass
