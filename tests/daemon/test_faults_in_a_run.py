"""A stepper table that fails in the course of a run: the run fails with a sentence, and nothing moves afterwards."""

import asyncio
import re
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path

import pytest

from calib import load_session
from daemon.emulation import EmulatedRig, emulated
from daemon.profile import load_profile
from daemon.service import Service, running_service
from daemon.store import RunRecord, RunState
from drivers.emulators.grbl import GrblEmulator
from tests.daemon.rigs import write_profile
from tests.drivers.grbl.benches import until

PATIENCE = 60.0
"""Seconds in which a run has ended after a fault, on a machine that is busy with other things."""

CHANGES = (
    ('options = { power_up_position = "3 mm" }', 'options = { letter = "X", machine_zero = "100 mm" }'),
    ('options = { power_up_position = "1 deg" }', 'options = { letter = "Y", machine_zero = "20 deg" }'),
    ('controller = "head"', 'controller = "stage"'),
    ('[controllers.head]\ndriver = "simulated"\n', ""),
    ('[controllers.stage]\ndriver = "simulated"', '[controllers.stage]\ndriver = "grbl"\nport = "none yet"'),
    (
        'name = "main"\ndriver = "simulated"',
        'name = "main"\ndriver = "stream"\noptions = { url = "http://none.yet/", latency = "500 ms" }',
    ),
    ("time_scale = 1\n", ""),
    ('frame_rate = "60 Hz"', 'frame_rate = "10 Hz"'),
)


def write_table(folder: Path) -> Path:
    """Write the small rig with real drivers."""
    path = write_profile(folder, time_scale=1)
    text = path.read_text(encoding="utf-8")
    for old, new in CHANGES:
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return path


class Course:
    """A run on emulated devices, and where it is."""

    def __init__(self, service: Service, rig: EmulatedRig, run: RunRecord) -> None:
        stage = rig.emulators["stage"]
        assert isinstance(stage, GrblEmulator)
        self.service, self.stage, self.run = service, stage, run

    def shafts(self) -> list[float]:
        now = self.service.rig.clock.now()
        return [motor.shaft.motor(now) for motor in self.stage.motors.values()]

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
        """Wait until the axes stand at the second position, where the run lets them settle."""
        await self.told("moving", position=2)
        await until(lambda: abs(self.shafts()[0] - 100 / 3) < 0.01)


async def homing(course: Course) -> None:
    await course.told("homing")
    await course.on_its_way()


async def moving(course: Course) -> None:
    await course.told("moving", position=2)
    await course.on_its_way()


async def settling(course: Course) -> None:
    await course.at_rest()


async def capturing(course: Course) -> None:
    await course.at_rest()
    await asyncio.sleep(0.3)


async def between_joints(course: Course) -> None:
    await course.told("joint", joint="pan")
    await course.on_its_way()


PHASES: tuple[Callable[[Course], Awaitable[None]], ...] = (
    homing,
    moving,
    settling,
    capturing,
    between_joints,
)
FAULTS: Mapping[str, tuple[Callable[[GrblEmulator], None], str]] = {
    "unplugged": (GrblEmulator.unplug, r"the port .* is gone"),
    "reset": (GrblEmulator.reset, r"has restarted and lost its position|knows where it is: home it"),
    "limit switch": (GrblEmulator.limit, r"in alarm 1: a limit switch tripped|knows where it is: home it"),
}


@pytest.mark.parametrize("phase", PHASES, ids=lambda phase: phase.__name__)
@pytest.mark.parametrize("fault", FAULTS)
async def test_a_fault_of_the_table_ends_the_run_with_a_sentence(
    fault: str, phase: Callable[[Course], Awaitable[None]], tmp_path: Path
) -> None:
    given = write_table(tmp_path)
    async with emulated(load_profile(given)) as rig:
        served = tmp_path / "served.toml"
        served.write_text(rig.profile_to_serve(given.read_text(encoding="utf-8")), encoding="utf-8")
        async with running_service(load_profile(served), tmp_path / "data") as service:
            course = Course(service, rig, await service.runs.start())
            async with asyncio.timeout(PATIENCE):
                await phase(course)
            happens, said = FAULTS[fault]
            happens(course.stage)
            async with asyncio.timeout(PATIENCE):
                await course.told("finished")
            run = await service.runs.get(course.run.id)
            assert run.state is RunState.FAILED
            assert re.search(said, str(run.error)), run.error
            assert run.calibration_id is None
            stood = course.shafts()
            await asyncio.sleep(0.5)
            assert course.shafts() == stood
            session = load_session(service.store.session_folder(run))
            assert not session.complete
