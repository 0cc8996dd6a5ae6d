"""The pose at a past time: right within what it claims while axes move, and refused where nothing is known."""

import asyncio
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, cast

import httpx
import numpy as np
import pytest

from calib import Calibration
from daemon.profile import Profile
from daemon.rig import Devices
from daemon.rig.utc import rfc3339
from daemon.service import Service
from drivers.axis import AxisState
from drivers.simulated import SimulatedController
from tests.daemon.calibrations import calibrate
from tests.daemon.motions import home_all, until
from tests.daemon.rigs import small_rig


@pytest.fixture
def profile(tmp_path: Path) -> Profile:
    """At twice the speed of life, so that a motion has readings in its midst."""
    return small_rig(tmp_path, time_scale=2.0)


@pytest.fixture
async def calibration(service: Service) -> Calibration:
    await home_all(service.rig)
    return calibrate(service)


def now() -> datetime:
    return datetime.now(UTC)


async def ask(client: httpx.AsyncClient, at: datetime | str) -> httpx.Response:
    return await client.get("/pose", params={"at": at if isinstance(at, str) else rfc3339(at)})


async def test_a_past_pose_is_where_the_camera_was(
    service: Service, client: httpx.AsyncClient, calibration: Calibration
) -> None:
    world = service.rig.world
    assert world is not None
    began = now()
    await service.rig.move({"slide": 25.0, "pan": 5.0})
    ended = now()
    times = [began + share * (ended - began) for share in np.random.default_rng(0).uniform(size=30).tolist()]
    answer = (await client.post("/pose", json={"times": [rfc3339(time) for time in times]})).json()
    assert answer["camera"] == "main"
    assert [pose["timestamp"] for pose in answer["poses"]] == [rfc3339(time) for time in times]
    moving = 0
    for time, pose in zip(times, answer["poses"], strict=True):
        stamp = service.rig.utc.stamp(time)
        true = [world.shaft(name)[1].motor(stamp) for name in service.rig.specs]
        assert (np.abs(np.subtract(pose["readings"], true)) <= np.add(pose["reading_bounds"], 1e-6)).all()
        assert all(first <= pose["timestamp"] <= last for first, last in pose["between"])
        expected = calibration.world_from_camera(pose["readings"])
        assert np.allclose(pose["world_from_camera"], expected, atol=1e-12)
        wider = calibration.pose_covariance(
            pose["readings"], approached=[0, 0], reading_std=np.divide(pose["reading_bounds"], 3**0.5)
        )
        assert np.allclose(pose["covariance"], wider)
        moving += pose["moving"] and max(pose["reading_bounds"]) > 0
    assert moving > 15
    one = (await ask(client, times[0])).json()
    assert one == answer["poses"][0] | {key: answer[key] for key in ("calibration_id", "camera")}


async def test_a_time_just_passed_is_answered_once_the_axes_are_read_again(
    service: Service, client: httpx.AsyncClient, calibration: Calibration
) -> None:
    asked = now()
    answer = await ask(client, asked)
    assert answer.status_code == 200
    assert answer.json()["timestamp"] == rfc3339(asked)
    assert answer.json()["out_of_range"] == []
    await service.rig.move({"pan": 14.0})
    beyond = now()
    assert (await ask(client, beyond)).json()["out_of_range"] == ["pan"]
    many = (await client.post("/pose", json={"times": [rfc3339(asked), rfc3339(beyond)]})).json()
    assert [pose["out_of_range"] for pose in many["poses"]] == [[], ["pan"]]


async def test_a_time_that_is_not_covered_is_a_404(
    service: Service, client: httpx.AsyncClient, calibration: Calibration
) -> None:
    for away, why in ((60, "ahead of this machine's clock"), (-60, "no axis had been read")):
        answer = await ask(client, now() + timedelta(seconds=away))
        assert (answer.status_code, answer.json()["code"]) == (404, "time_not_covered")
        assert why in answer.json()["detail"]
    answer = await client.post("/pose", json={"times": [rfc3339(now()), "2001-01-01T00:00:00Z"]})
    assert (answer.status_code, answer.json()["code"]) == (404, "time_not_covered")


@pytest.mark.parametrize("text", ["", "yesterday", "2026-03-14T09:26:53"])
async def test_what_is_no_time_in_a_zone_is_refused(client: httpx.AsyncClient, text: str) -> None:
    answer = await ask(client, text)
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")
    assert [wrong["field"] for wrong in answer.json()["errors"]] == ["query.at"]


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"times": []},
        {"times": ["2026-03-14T09:26:53"]},
        {"times": ["2026-03-14T09:26:53Z"], "readings": [[0, 0]]},
        {"times": ["2026-03-14T09:26:53Z"], "approached": [[0, 0]]},
    ],
)
async def test_readings_or_times_are_given(client: httpx.AsyncClient, body: dict[str, Any]) -> None:
    answer = await client.post("/pose", json=body)
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")


async def test_a_loss_leaves_a_gap_and_no_old_pose(
    service: Service, client: httpx.AsyncClient, devices: Devices, calibration: Calibration
) -> None:
    stage, rig = cast(SimulatedController, devices.controllers["stage"]), service.rig
    before = now()
    await rig.fresh_snapshot(rig.clock.now())
    stage.inject("lost")
    await until(rig, lambda snapshot: snapshot.axis("slide").lost is not None)
    lost = now()
    answer = await ask(client, lost)
    assert (answer.status_code, answer.json()["code"]) == (503, "device_lost")
    assert (await ask(client, before)).status_code == 200
    stage.repair()
    await until(rig, lambda snapshot: snapshot.axis("slide").lost is None)
    unhomed = now()
    await rig.home("slide")
    for gap in (lost, unhomed):
        answer = await ask(client, gap)
        assert (answer.status_code, answer.json()["code"]) == (404, "time_not_covered")
        assert "axis 'slide'" in answer.json()["detail"]
    for known in (before, now()):
        assert (await ask(client, known)).status_code == 200


async def test_axes_that_fall_silent_are_a_503(
    service: Service,
    client: httpx.AsyncClient,
    devices: Devices,
    calibration: Calibration,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def silent() -> AxisState:
        await asyncio.Event().wait()
        raise AssertionError

    impatient = replace(service.profile.procedure, max_reading_age=0.05)
    monkeypatch.setattr(service.rig, "profile", replace(service.profile, procedure=impatient))
    monkeypatch.setattr(devices.controllers["stage"].axes["slide"], "read", silent)
    answer = await ask(client, now())
    assert (answer.status_code, answer.json()["code"]) == (503, "reading_stale")
