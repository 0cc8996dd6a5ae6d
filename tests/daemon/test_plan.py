"""What is looked at before a run: its plan, its checklist, and sweeps that start from where the axes stand."""

import contextlib
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import httpx
import pytest

from calib import load_session
from daemon.api import create_app
from daemon.procedure.plan import planned_positions, travel_time
from daemon.rig import Devices
from daemon.service import Service, running_service
from daemon.store import RunState
from drivers.axis import AxisSpec
from drivers.simulated import SimulatedController
from tests.daemon.calibrations import calibrate
from tests.daemon.motions import home_all, to_and_fro, until
from tests.daemon.rigs import LOOKING_AWAY, small_rig
from tests.daemon.runs import finish, of


async def checks(client: httpx.AsyncClient, **query: str) -> tuple[bool, dict[str, Any]]:
    answer = await client.get("/runs/checklist", params=query)
    assert answer.status_code == 200, answer.text
    document = answer.json()
    return document["ready"], {check["name"]: check for check in document["checks"]}


async def test_the_plan_is_what_the_run_then_does(client: httpx.AsyncClient, service: Service) -> None:
    plan = (await client.get("/runs/plan")).json()
    assert (plan["views"], plan["joints"], plan["from_here"]) == (10, ["slide", "pan"], [])
    assert plan["seconds"] == pytest.approx(sum(position["seconds"] for position in plan["positions"]))
    _, events = await finish(service, await service.runs.start())
    for position, view in zip(plan["positions"], of(events, "view"), strict=True):
        assert (position["position"], position["joint"], position["use"]) == (
            view.position,
            view.joint,
            view.use,
        )
        assert view.readings == pytest.approx(position["readings"], abs=0.05)


def test_an_axis_takes_as_long_as_its_velocity_and_acceleration_allow() -> None:
    spec = AxisSpec("slide", "prismatic", "mm", (0.0, 100.0), velocity=10.0, acceleration=5.0, tolerance=0.1)
    assert travel_time(spec, -5.0) == pytest.approx(
        2.0
    )  # half of it speeding up, at 5 mm/s^2, half slowing down
    assert travel_time(spec, 50.0) == pytest.approx(7.0)  # 2 s and 10 mm for each of these, 3 s in between
    assert travel_time(spec, 0.0) == 0.0


def test_a_longer_way_takes_longer(tmp_path: Path) -> None:
    profile = small_rig(tmp_path, time_scale=1.0)
    near, far, unknown = (
        planned_positions(profile, profile.procedure, standing)[0].seconds
        for standing in ([0.0, 0.0], [60.0, 0.0], [None, 0.0])
    )
    assert near == pytest.approx(0.1 + 0.3)  # settling and looking
    assert far == pytest.approx(near + 0.6 + 0.25)
    assert unknown == pytest.approx(near + 1.0 + 0.25)


async def test_a_sweep_starts_from_where_the_axes_stand(client: httpx.AsyncClient, service: Service) -> None:
    await home_all(service.rig)
    await service.rig.move({"slide": 60.0, "pan": 3.0})
    plan = (await client.get("/runs/plan", params={"from_here": "pan"})).json()
    assert plan["from_here"] == ["pan"]
    pan = [position["readings"] for position in plan["positions"] if position["joint"] == "pan"]
    assert [round(readings[1], 3) for readings in pan] == [-12.0, -4.0, 4.0, 12.0]
    assert all(abs(readings[0] - 60.0) < 0.05 for readings in pan)

    answer = await client.post("/runs", json={"from_here": ["pan"]})
    assert answer.status_code == 202
    run = await service.runs.wait(answer.json()["id"])
    assert run.state is RunState.SUCCEEDED
    session = load_session(service.store.session_folder(run))
    assert set(session.starts) == {"pan"}
    for position, view in zip(plan["positions"], session.views, strict=True):
        assert view.readings == pytest.approx(position["readings"], abs=0.05)
    # The pan goes down to its first position as it would have from the profile's start.
    assert [view.approached[1] for view in session.views[4:8] if view.approached] == [-1, 1, 1, 1]


def test_sweeps_that_start_from_the_same_place_do_so_from_here_too(tmp_path: Path) -> None:
    procedure = small_rig(tmp_path).procedure
    slide, pan = procedure.sweeps
    backwards = replace(pan, readings=pan.readings[::-1], start={**pan.start, "pan": 12.0}, use="verify")
    from_elsewhere = replace(pan, start={**pan.start, "slide": 20.0})
    sweeps = (slide, pan, backwards, from_elsewhere)
    started = replace(procedure, sweeps=sweeps).starting({"pan": [60.0, 3.0]}).sweeps
    assert [dict(sweep.start) for sweep in started] == [
        {"slide": 0.0, "pan": 0.0},
        {"slide": 60.0, "pan": -12.0},
        {"slide": 60.0, "pan": 12.0},
        {"slide": 20.0, "pan": -12.0},
    ]
    assert [sweep.readings for sweep in started] == [sweep.readings for sweep in sweeps]


async def test_a_run_that_is_resumed_starts_its_sweeps_from_where_it_was_told(service: Service) -> None:
    await home_all(service.rig)
    await service.rig.move({"slide": 60.0})
    run = await service.runs.start(from_here=["pan"])
    async for event in service.runs.events(run.id):
        if event.type == "view" and event.view == 2:
            await service.runs.cancel(run.id)
    run, _ = await finish(service, await service.runs.resume(run.id))
    assert run.state is RunState.SUCCEEDED
    session = load_session(service.store.session_folder(run))
    assert [round(view.readings[0]) for view in session.views if view.joint == "pan"] == [60] * 4


async def test_what_cannot_start_from_here_is_refused_before_anything_moves(
    client: httpx.AsyncClient, service: Service, devices: Devices
) -> None:
    async def refused(joint: str) -> tuple[int, str]:
        answer = await client.post("/runs", json={"from_here": [joint]})
        assert (await client.get("/runs")).json() == []
        assert service.leases.current is None
        return answer.status_code, answer.json()["code"]

    assert await refused("pan") == (409, "not_homed")
    assert (await client.get("/runs/plan", params={"from_here": "pan"})).json()["code"] == "not_homed"
    await home_all(service.rig)
    assert await refused("tilt") == (404, "unknown_axis")
    assert (await client.get("/runs/checklist", params={"from_here": "tilt"})).status_code == 404
    lease = service.leases.acquire("anna", "", 60)
    moving = await service.motions.begin(lease, ["slide"], to_and_fro(service.rig, "slide"))
    answer = await client.post("/runs", json={"from_here": ["pan"]}, headers={"X-Lease": lease.token})
    assert (answer.status_code, answer.json()["code"]) == (409, "axis_busy")
    assert not moving.done()
    service.leases.release(lease.token)


async def test_a_rig_that_is_ready_has_nothing_against_it(
    client: httpx.AsyncClient, service: Service
) -> None:
    await home_all(service.rig)
    await service.rig.move({"slide": 50.0})
    ready, found = await checks(client)
    assert ready
    assert {name for name, check in found.items() if check["ok"]} == {
        "devices", "stop", "free", "homed", "target", "picture", "settings", "disk",
    }  # fmt: skip
    assert "20 of 20 points" in found["target"]["message"]
    assert found["room"]["ok"] is None  # nothing is calibrated
    calibrate(service)
    _, found = await checks(client)
    assert found["room"]["ok"] is True


async def test_what_stands_against_a_run_is_said(
    client: httpx.AsyncClient, service: Service, devices: Devices, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready, found = await checks(client)
    assert (ready, found["homed"]["ok"]) == (True, None)  # it will be homed
    service.leases.acquire("anna", "", 60)
    await service.rig.stop("a test")
    cast(SimulatedController, devices.controllers["head"]).inject("lost")
    await until(service.rig, lambda snapshot: bool(snapshot.problems))
    usage = type("Usage", (), {"free": 1e6})()
    monkeypatch.setattr("daemon.procedure.checklist.shutil.disk_usage", lambda _: usage)
    ready, found = await checks(client)
    assert not ready
    assert {name for name, check in found.items() if check["ok"] is False} == {"devices", "stop", "disk"}
    assert (found["free"]["ok"], found["free"]["message"]) == (None, "'anna' has control")


@contextlib.asynccontextmanager
async def other_rig(folder: Path, **changes: Any) -> AsyncIterator[tuple[Service, httpx.AsyncClient]]:
    async with running_service(small_rig(folder, **changes), folder / "data") as service:
        transport = httpx.ASGITransport(create_app(service))
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost/api/v1") as client:
            yield service, client


async def test_a_target_that_is_not_seen_is_said(tmp_path: Path) -> None:
    async with other_rig(tmp_path, look_at=LOOKING_AWAY) as (_, client):
        ready, found = await checks(client)
    assert (ready, found["target"]["ok"]) == (False, False)
    assert "picture" not in found


async def test_a_target_that_would_leave_the_picture_is_said(tmp_path: Path) -> None:
    async with other_rig(tmp_path, reach=20.0) as (service, client):
        calibrate(service)
        _, found = await checks(client)
        assert found["room"]["ok"] is True
        await home_all(service.rig)  # the slide stands at its end, from where the pan looks past the target
        ready, found = await checks(client, from_here="pan")
    assert (ready, found["room"]["ok"]) == (False, False)
    assert "in the picture at 1 of 10 positions (8)" in found["room"]["message"]
