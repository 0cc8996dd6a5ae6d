"""Waiting for what a rig does, by its state and never by the clock on the wall."""

from collections.abc import Callable
from itertools import cycle

from daemon.client_motion import Motion
from daemon.rig import Permit, Rig, RigSnapshot


async def home_all(rig: Rig) -> None:
    for name in rig.specs:
        await rig.home(name)


async def until(rig: Rig, condition: Callable[[RigSnapshot], bool]) -> RigSnapshot:
    """Return the first snapshot that meets `condition`."""
    while not condition(rig.snapshot):
        await rig.changed.wait()
    return rig.snapshot


def to_and_fro(rig: Rig, axis: str, distance: float = 9.0) -> Motion:
    """Return a motion of an axis that goes on until it is stopped, so that no machine is too slow to meet it."""

    async def motion(permit: Permit) -> None:
        for way in cycle((distance, -distance)):
            await rig.jog(axis, way, permit)

    return motion
