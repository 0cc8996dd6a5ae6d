"""An axis that a killed daemon has left in motion is stopped by the next one before anything else."""

import asyncio
import logging
import re
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
import tomlkit

from daemon.profile import Profile, load_profile
from daemon.profile.source import read_profile
from daemon.rig import Devices, Rig
from drivers.clock import SystemClock
from drivers.driver import DriverContext
from drivers.emulators.cia402.emulator import Cia402Emulator
from drivers.emulators.emulator import Emulator
from drivers.emulators.registry import controller_emulator
from drivers.simulated import SimulatedWorld
from drivers.simulated.motion import trapezoid

LEAVE_MOVING = """
import asyncio
import sys
from daemon.profile import load_profile
from daemon.rig import make_devices

async def main(profile, axis, distance):
    [controller] = make_devices(load_profile(profile)).controllers.values()
    await controller.open()
    motion = asyncio.create_task(controller.axes[axis].jog(float(distance)))
    while not (await controller.axes[axis].read()).moving and not motion.done():
        pass  # a driver asks its device no more often than it should
    print("moving", flush=True)
    await motion

asyncio.run(main(*sys.argv[1:]))
"""


async def test_a_simulated_axis_is_stopped(
    profile: Profile, devices: Devices, caplog: pytest.LogCaptureFixture
) -> None:
    assert devices.world is not None
    shaft, now = devices.world.shaft("slide")[1], devices.clock.now()
    shaft.drive(trapezoid(shaft.motor(now), 90.0, now, velocity=0.5, acceleration=1.0))
    with caplog.at_level(logging.WARNING):
        rig = await Rig.open(profile, devices)
    assert not rig.snapshot.moving
    assert "axis 'slide' was found moving, and is stopped" in caplog.text
    await rig.close()


@asynccontextmanager
async def emulated_controller(
    name: str, folder: Path
) -> AsyncIterator[tuple[Path, Emulator, SimulatedWorld]]:
    """A shipped profile whose controller is emulated, and whose camera is not plugged in.

    Its axes are so slow that a jog goes on however long a busy machine takes to stop it.
    """
    slowly = re.sub(r'velocity = "\d+', 'velocity = "5', read_profile(name).text)
    served = folder / "served.toml"
    served.write_text(slowly, encoding="utf-8")
    profile, clock = load_profile(served), SystemClock()
    assert profile.simulation is not None
    specs = {axis.spec.name: axis.spec for axis in profile.axes}
    world = SimulatedWorld(profile.simulation, list(specs.values()), profile.target.model_dump(), clock)
    [(controller, of)] = profile.controllers.items()
    emulator = controller_emulator(of.driver).create(
        specs,
        of.options,
        {axis.spec.name: axis.options for axis in profile.axes},
        DriverContext(clock, world),
    )
    document = tomlkit.parse(slowly)
    document["controllers"][controller].update(await emulator.start())  # type: ignore[index,union-attr]
    served.write_text(tomlkit.dumps(document), encoding="utf-8")
    try:
        yield served, emulator, world
    finally:
        await emulator.close()


@pytest.mark.parametrize(
    ("name", "axis", "distance", "guarded"),
    [
        ("grbl-table", "slide", -140.0, True),
        ("cia402-pan-tilt", "pan", 55.0, True),
        ("cia402-pan-tilt", "pan", 55.0, False),
    ],
)
async def test_an_emulated_axis_is_stopped_after_a_kill(
    tmp_path: Path, name: str, axis: str, distance: float, guarded: bool
) -> None:
    async with emulated_controller(name, tmp_path) as (served, emulator, world):
        shaft = world.shaft(axis)[1]
        command = (sys.executable, "-c", LEAVE_MOVING, str(served), axis, str(distance))
        process = await asyncio.create_subprocess_exec(*command, stdout=asyncio.subprocess.PIPE)
        assert process.stdout is not None
        assert await process.stdout.readline() == b"moving\n"
        left = shaft.motion
        assert left.velocity(world.clock.now())
        process.kill()
        await process.wait()
        if not guarded and isinstance(emulator, Cia402Emulator):
            # A drive that does not notice when nobody is there any more.
            emulator.nodes[axis].set_data(0x1016, 1, bytes(4))
        rig = await Rig.open(load_profile(served))
        assert rig.axis(axis).lost is None
        assert not rig.axis(axis).moving
        assert shaft.motor(world.clock.now()) != left.target
        assert not shaft.motion.velocity(world.clock.now())
        await rig.close()
