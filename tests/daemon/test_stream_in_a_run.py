"""Runs whose camera is an emulated stream: it goes wrong in every phase, and nothing else does."""

import dataclasses
import json
from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np
import pytest

from calib import load_calibration
from daemon.procedure import RunEvent
from daemon.profile import Profile
from daemon.rig import Devices, make_devices
from daemon.service import Service
from daemon.store import RunState
from drivers.driver import DriverContext
from drivers.emulators.camera import StreamEmulator
from drivers.video.options import StreamOptions
from drivers.video.stream import StreamCamera
from tests.daemon.motions import until
from tests.daemon.rigs import small_rig


@pytest.fixture
def profile(tmp_path: Path) -> Profile:
    # As many pictures a second as leave time for everything else.
    return small_rig(tmp_path, time_scale=1.0, velocity=400.0, frame_rate="15 Hz")


@pytest.fixture
def simulated(profile: Profile) -> Devices:
    return make_devices(profile)


@pytest.fixture
async def emulator(profile: Profile, simulated: Devices) -> AsyncIterator[StreamEmulator]:
    options = StreamOptions(url="http://nowhere", latency="1 s")
    context = DriverContext(simulated.clock, simulated.world)
    running = StreamEmulator.create(profile.camera.spec, options, context)
    await running.start()
    yield running
    await running.close()


@pytest.fixture
def devices(
    request: pytest.FixtureRequest, profile: Profile, simulated: Devices, emulator: StreamEmulator
) -> Devices:
    durations = {"exposure": "10 ms", "latency": "1 s", "timeout": "2 s"} | getattr(request, "param", {})
    options = StreamOptions(url=emulator.url, **durations)
    context = DriverContext(simulated.clock)
    return dataclasses.replace(simulated, camera=StreamCamera.create(profile.camera.spec, options, context))


async def test_a_camera_that_nobody_looks_through_is_noticed_to_be_gone(
    service: Service, emulator: StreamEmulator
) -> None:
    emulator.unplug()
    snapshot = await until(service.rig, lambda snapshot: len(snapshot.problems) > 0)
    assert "camera 'main' is lost" in snapshot.problems[0]
    emulator.repair()
    await until(service.rig, lambda snapshot: snapshot.problems == [])


@pytest.mark.parametrize(
    ("phase", "fault"),
    [
        ("homing", "freeze"),
        ("joint", "truncate"),
        ("moving", "unplug"),
        ("view", "repeat"),
    ],
)
async def test_a_camera_that_fails_ends_the_run_in_words_and_is_found_again(
    service: Service, emulator: StreamEmulator, phase: str, fault: str
) -> None:
    run = await service.runs.start("anna", "first light")
    events: list[RunEvent] = []
    async for event in service.runs.events(run.id):
        if event.type == phase:
            emulator.faults[fault].inject()
        events.append(event)
    ended = await service.runs.get(run.id)
    assert ended.state is RunState.FAILED
    assert "camera 'main'" in (ended.error or "")
    views = [event for event in events if event.type == "view"]
    session = json.loads((service.store.session_folder(ended) / "session.json").read_text())
    assert len(session["views"]) == len(views)
    assert session["complete"] is False

    rig = service.rig
    stood = (await rig.fresh_snapshot(rig.clock.now())).readings
    emulator.repair()
    await until(rig, lambda snapshot: all(device.lost is None for device in snapshot.devices))
    await rig.frame(after=rig.clock.now())
    after = await rig.fresh_snapshot(rig.clock.now())
    assert after.readings == stood
    assert not after.moving


@pytest.mark.parametrize(
    "devices", [{"latency": "1.6 s", "timeout": "30 s"}], indirect=True
)  # of a machine that has other things to do
async def test_a_run_through_a_stream_that_falls_behind_finds_the_truth(
    service: Service, emulator: StreamEmulator
) -> None:
    run = await service.runs.start("anna", "by the network")
    async for event in service.runs.events(run.id):
        if event.type == "joint" and event.joint == "pan":
            emulator.delay(0.8)
    ended = await service.runs.get(run.id)
    assert ended.error is None
    world = service.rig.world
    assert world is not None
    calibration = load_calibration(service.store.session_folder(ended) / "calibration.json")
    for readings in ([10.0, -8.0], [50.0, 0.0], [95.0, 11.0]):
        found, true = calibration.world_from_camera(readings), world.world_from_camera(readings)
        # What ten small pictures tell; one of an earlier position would be off by tens of millimetres.
        assert np.linalg.norm(found[:3, 3] - true[:3, 3]) < 2e-3
        assert np.linalg.norm(found[:3, :3] - true[:3, :3]) < 2e-3
