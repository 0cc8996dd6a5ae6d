"""Runs on an emulated controller that goes wrong, one for every phase of a run, side by side."""

import asyncio
import dataclasses
import re
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from calib import load_session
from daemon.profile import load_profile
from daemon.rig import make_devices
from daemon.service import Service, running_service
from daemon.store import RunRecord, RunState
from drivers.camera import Frame
from drivers.driver import DriverContext
from drivers.emulators.registry import controller_emulator
from drivers.registry import controller_driver
from tests.daemon.rigs import write_profile
from tests.drivers.clocks import PatientClock
from tests.drivers.grbl.benches import until

PATIENCE = 60.0
"""Seconds in which a run has ended after a fault, on a machine that is busy with other things."""
STANDING = 0.5
"""Seconds for which axes are watched to stand."""
FAR = 100.0
"""Where (mm) the slide stands at the second position of a run."""

CHANGES = (
    ('options = { power_up_position = "3 mm" }', ""),
    ('options = { power_up_position = "1 deg" }', ""),
    ('controller = "head"', 'controller = "stage"'),
    ('[controllers.head]\ndriver = "simulated"\n', ""),
    ('acceleration = "400 mm/s2"', 'acceleration = "1500 mm/s2"'),
    ('velocity = "40 deg/s"', 'velocity = "80 deg/s"'),
    ('acceleration = "200 deg/s2"', 'acceleration = "800 deg/s2"'),
)
"""To the small rig, for both of its axes to be on one controller, and to be soon where they are disturbed."""


@dataclass(frozen=True)
class Equipment:
    """A controller of the small rig's axes."""

    driver: str
    place: str
    """The option that says where the device is; the emulator may be elsewhere."""
    options: Mapping[str, object]
    axes: Mapping[str, Mapping[str, object]]
    """Options of each axis."""


class Course:
    """A run, and where it is."""

    def __init__(self, service: Service, emulator: Any, run: RunRecord) -> None:
        self.service, self.emulator, self.run = service, emulator, run

    def shafts(self) -> list[float]:
        """Where the axes truly are."""
        rig = self.service.rig
        assert rig.world is not None
        return [rig.world.shaft(name)[1].motor(rig.clock.now()) for name in rig.specs]

    async def told(self, kind: str, **keys: object) -> None:
        """Wait until the run has told something."""
        async for event in self.service.runs.events(self.run.id):
            if event.type == kind and all(getattr(event, key) == value for key, value in keys.items()):
                return
        pytest.fail(f"the run has ended before its {kind}")

    async def on_its_way(self) -> None:
        """Wait until an axis moves."""
        before = self.shafts()
        await until(lambda: self.shafts() != before)

    async def at_rest(self) -> None:
        """Wait until the axes are known to stand at the second position, where the run lets them settle."""
        await self.told("moving", position=2)
        await until(lambda: abs(self.shafts()[0] - FAR) < 0.01 and not self.service.rig.snapshot.moving)

    async def looking(self) -> None:
        """Wait until the run asks for a picture."""
        rig, asked = self.service.rig, asyncio.Event()
        frame = rig.frame

        async def noted(after: float | None = None) -> Frame:
            asked.set()
            return await frame(after)

        rig.frame = noted  # type: ignore[method-assign]
        await asked.wait()
        rig.frame = frame  # type: ignore[method-assign]

    async def stand(self) -> bool:
        """Return whether no axis moves."""
        before = self.shafts()
        await asyncio.sleep(0.05)
        return self.shafts() == before


async def homing(course: Course) -> None:
    await course.told("homing")
    await course.on_its_way()


async def moving(course: Course) -> None:
    await course.told("moving", position=2)
    await course.on_its_way()


async def settling(course: Course) -> None:
    await course.at_rest()


async def capturing(course: Course) -> None:
    await course.told("moving", position=2)
    await course.looking()


async def between_joints(course: Course) -> None:
    await course.told("joint", joint="pan")
    await course.on_its_way()


Phase = Callable[[Course], Awaitable[None]]
PHASES: tuple[Phase, ...] = (homing, moving, settling, capturing, between_joints)

Faults = Mapping[str, tuple[Callable[[Any], None], str]]
"""What is done to the emulator, and what the run says then, as a regular expression."""


async def expect_failures(
    equipment: Equipment, fault: tuple[Callable[[Any], None], str], folder: Path
) -> None:
    """Let it happen in every phase, each in a run of its own, and expect all of them to fail in good order."""
    async with asyncio.TaskGroup() as side_by_side:
        for phase in PHASES:
            (folder / phase.__name__).mkdir()
            side_by_side.create_task(_expect_failure(equipment, phase, fault, folder / phase.__name__))


async def _expect_failure(
    equipment: Equipment, phase: Phase, fault: tuple[Callable[[Any], None], str], folder: Path
) -> None:
    happens, said = fault
    async with running(equipment, folder) as course:
        async with asyncio.timeout(PATIENCE):
            await phase(course)
            happens(course.emulator)
            await course.told("finished")
        run = await course.service.runs.get(course.run.id)
        where = f"{phase.__name__}: {run.error}"
        assert run.state is RunState.FAILED, where
        assert re.search(said, str(run.error)), where
        assert run.calibration_id is None, where
        # Where nothing reaches a device any more, it is for the device to stop.
        assert await course.stand() or "a standstill could not be confirmed" in str(run.error), where
        async with asyncio.timeout(PATIENCE):
            await until(course.stand)
        stood = course.shafts()
        await asyncio.sleep(STANDING)
        assert course.shafts() == stood, where
        assert not load_session(course.service.store.session_folder(run)).complete, where


@asynccontextmanager
async def running(
    equipment: Equipment, folder: Path, *, positions: int = 2, reach: float = 12.0
) -> AsyncIterator[Course]:
    """Start a run of the small rig on emulated equipment, with a simulated camera, in a folder that is there."""
    profile = load_profile(write_small_rig(folder, positions, reach))
    devices = make_devices(profile, PatientClock())
    context = DriverContext(devices.clock, devices.world)
    driver, specs = controller_driver(equipment.driver), {axis.spec.name: axis.spec for axis in profile.axes}
    options = {**equipment.options, equipment.place: str(folder)}
    axes = {name: driver.AxisOptions.model_validate(keys) for name, keys in equipment.axes.items()}
    emulator = controller_emulator(equipment.driver).create(
        specs, driver.Options.model_validate(options), axes, context
    )
    try:
        options[equipment.place] = (await emulator.start())[equipment.place]
        controller = driver.create(specs, driver.Options.model_validate(options), axes, context)
        devices = dataclasses.replace(devices, controllers={"stage": controller})
        async with running_service(profile, folder / "data", devices) as service:
            yield Course(service, emulator, await service.runs.start())
    finally:
        await emulator.close()


def write_small_rig(folder: Path, positions: int, reach: float) -> Path:
    """Write the small rig with both axes on one controller, whose motions last long enough to be disturbed."""
    path = write_profile(folder, time_scale=1, velocity=300, positions=positions, reach=reach)
    text = path.read_text(encoding="utf-8")
    for old, new in CHANGES:
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return path
