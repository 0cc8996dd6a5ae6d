"""What a driver has to say of its device reaches whoever uses the rig: by the API, the log and a run's events."""

import dataclasses
from pathlib import Path

import httpx
import pytest

from daemon.api import create_app
from daemon.profile import Profile
from daemon.rig import Devices
from daemon.service import running_service
from drivers.driver import DriverContext
from drivers.simulated import SimulatedCamera

SENTENCE = "camera 'main' focuses by itself, which moves the lens that is being calibrated"


class SelfFocusing(SimulatedCamera):
    """A camera that cannot be kept from it."""

    @property
    def warnings(self) -> list[str]:
        return [SENTENCE]


@pytest.fixture
def devices(devices: Devices, profile: Profile) -> Devices:
    camera = profile.camera
    assert isinstance(camera.options, SimulatedCamera.Options)
    context = DriverContext(devices.clock, devices.world)
    return dataclasses.replace(devices, camera=SelfFocusing.create(camera.spec, camera.options, context))


async def test_it_is_in_the_rig_in_the_log_and_in_a_runs_events(
    profile: Profile, devices: Devices, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async with running_service(profile, tmp_path / "data", devices) as service:
        transport = httpx.ASGITransport(create_app(service))
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost/api/v1") as client:
            rig = (await client.get("/rig")).json()
        warnings = {device["name"]: device["warnings"] for device in rig["devices"]}
        assert warnings == {"stage": [], "head": [], "main": [SENTENCE]}
        assert caplog.messages.count(SENTENCE) == 1
        run = await service.runs.start("anna", "unfocused")
        events = [event async for event in service.runs.events(run.id)]
    assert [event.message for event in events if event.type == "warning"] == [SENTENCE]
