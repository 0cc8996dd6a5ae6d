"""Waiting for what a rig does, by its state and never by the clock on the wall."""

from collections.abc import Callable

from daemon.rig import Rig, RigSnapshot


async def home_all(rig: Rig) -> None:
    for name in rig.specs:
        await rig.home(name)


async def until(rig: Rig, condition: Callable[[RigSnapshot], bool]) -> RigSnapshot:
    """Return the first snapshot that meets `condition`."""
    while not condition(rig.snapshot):
        await rig.changed.wait()
    return rig.snapshot
