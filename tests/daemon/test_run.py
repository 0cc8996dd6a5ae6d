"""A whole run in process: begun, paused, cancelled."""

import json
import threading
from pathlib import Path
from typing import cast

import cv2
import httpx
import numpy as np
import pytest

from calib import load_calibration, load_session
from daemon.errors import (
    LeaseHeldError,
    RigFaultError,
    RunActiveError,
    RunStateError,
    StopLatchedError,
    StoreError,
)
from daemon.procedure import RunEvent
from daemon.procedure.event_log import read_events
from daemon.rig import Devices
from daemon.service import Service, running_service
from daemon.store import RunState
from drivers.simulated import SimulatedController
from tests.daemon.motions import to_and_fro, until
from tests.daemon.rigs import small_rig
from tests.daemon.runs import finish, of


async def test_a_run_ends_with_an_active_calibration(
    service: Service, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    run, events = await finish(service, await service.runs.start("anna", "first light"))
    assert run.state is RunState.SUCCEEDED
    assert run.error is None
    assert [event.sequence for event in events] == list(range(1, len(events) + 1))
    assert [event.type for event in events[:4]] == ["state", "plan", "homing", "homing"]
    assert [event.joint for event in of(events, "joint")] == ["slide", "pan", None]
    assert events[1].type == "plan"
    assert events[1].views == len(of(events, "moving")) == len(of(events, "view")) == 10
    quality = of(events, "solved")[0].quality
    assert quality["rms_px"] < 0.2
    assert quality["verdict"].lower().startswith(quality["judgement"])
    assert f"run '{run.id}' succeeded: {quality['verdict']}" in caplog.messages
    assert [entry.verdict for entry in await service.store.calibrations()] == [quality["verdict"]]
    assert of(events, "verification")[0].result["views"] == 2
    assert events[-1].type == "finished"
    assert events[-1].calibration_id == run.calibration_id == service.poses.calibration_id

    folder = service.store.session_folder(run)
    assert read_events(folder) == events
    document = json.loads((folder / "session.json").read_text())
    assert document["complete"] is True
    assert run.calibration_id is not None
    stored = await service.store.calibration(run.calibration_id)
    assert json.loads(stored.document) == json.loads((folder / "calibration.json").read_text())
    assert load_calibration(folder / "calibration.json").method == "ml"


async def test_a_sharp_run_has_no_warnings_and_a_blurred_one_has_one_a_sweep(tmp_path: Path) -> None:
    for defocus, warned in (("0.5 px", 0), ("2.5 px", 3)):
        (tmp_path / defocus).mkdir()
        profile = small_rig(tmp_path / defocus, defocus=defocus)
        async with running_service(profile, tmp_path / defocus / "data") as service:
            _, events = await finish(service, await service.runs.start())
        messages = [
            event.message for event in of(events, "warning") if "measured all the same" in event.message
        ]
        assert len(messages) == warned
        assert len(of(events, "view")) == 10
        for message in messages:
            assert "of 10 is measured all the same: the picture is blurred: edges are " in message


async def test_a_view_says_how_it_was_taken(service: Service) -> None:
    run, _ = await finish(service, await service.runs.start())
    session = load_session(service.store.session_folder(run))
    assert [view.use for view in session.views] == ["fit"] * 8 + ["verify"] * 2
    # The slide grows through its sweep; the pan goes down to its start first, and grows from there.
    assert [view.approached[0] for view in session.views[1:4] if view.approached] == [1, 1, 1]
    assert [view.approached[1] for view in session.views[4:8] if view.approached] == [-1, 1, 1, 1]
    for view in session.views:
        extra = view.model_extra or {}
        assert extra["time"].endswith("Z")
        assert extra["settle"]["settled_s"] >= 0.1
        assert view.image is not None
        picture = cv2.imread(str(session.folder / view.image))
        assert picture is not None
        assert picture.shape[:2] == (360, 480)
    assert np.allclose(
        [view.readings[0] for view in session.views[:4]], [0, 100 / 3, 200 / 3, 100], atol=0.05
    )


async def test_there_is_one_run_at_a_time_under_its_own_lease(service: Service) -> None:
    run = await service.runs.start()
    with pytest.raises(RunActiveError, match=run.id):
        await service.runs.start()
    with pytest.raises(LeaseHeldError, match=f"run {run.id}"):
        service.leases.acquire("anna", "", 60)
    await service.runs.cancel(run.id)
    assert service.leases.current is None
    with pytest.raises(RunStateError, match="not under way"):
        await service.runs.cancel(run.id)


async def test_a_run_that_cannot_start_leaves_no_trace(service: Service, devices: Devices) -> None:
    await service.rig.stop("a test")
    with pytest.raises(StopLatchedError):
        await service.runs.start()
    service.rig.acknowledge_stop()
    lease = service.leases.acquire("anna", "", 60)
    with pytest.raises(LeaseHeldError, match="'anna'"):
        await service.runs.start()
    service.leases.release(lease.token)
    cast(SimulatedController, devices.controllers["head"]).inject("lost")
    await until(service.rig, lambda snapshot: bool(snapshot.problems))
    with pytest.raises(RigFaultError, match="controller 'head' is lost"):
        await service.runs.start()
    assert await service.runs.list() == []
    assert service.leases.current is None


async def test_a_run_whose_start_is_not_stored_leaves_its_starter_the_lease_and_the_motion(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def full(_: object) -> None:
        raise StoreError("the disk is full")

    monkeypatch.setattr(service.store, "add_run", full)
    lease = service.leases.acquire("anna", "", 60)
    jog = await service.motions.begin(lease, ["slide"], to_and_fro(service.rig, "slide"))
    with pytest.raises(StoreError):
        await service.runs.start(token=lease.token)
    assert service.leases.current == lease
    assert not jog.done()


async def test_a_paused_run_rests_between_two_views_and_goes_on(service: Service) -> None:
    run = await service.runs.start()
    seen: list[RunEvent] = []
    async for event in service.runs.events(run.id):
        seen.append(event)
        if event.type == "view" and event.view == 1:
            service.runs.pause(run.id)
            with pytest.raises(RunStateError, match="is paused"):
                service.runs.pause(run.id)
        if event.type == "state" and event.state is RunState.PAUSED:
            assert (await service.store.run(run.id)).state is RunState.PAUSED
            assert not service.rig.snapshot.moving
            await service.runs.resume(run.id)
            with pytest.raises(RunStateError, match="not paused"):
                await service.runs.resume(run.id)
    assert [event.state for event in of(seen, "state")] == ["running", "paused", "running"]
    # At most the view in flight came between the asking and the rest.
    assert seen.index(of(seen, "state")[1]) - seen.index(of(seen, "view")[1]) <= 3
    assert (await service.runs.get(run.id)).state is RunState.SUCCEEDED


async def test_a_run_that_is_paused_again_at_once_rests_where_it_rested(service: Service) -> None:
    run = await service.runs.start()
    service.runs.pause(run.id)
    seen: list[RunEvent] = []
    async for event in service.runs.events(run.id):
        seen.append(event)
        if event.type == "state" and event.state is RunState.PAUSED:
            if len(of(seen, "state")) > 2:
                break
            await service.runs.resume(run.id)
            service.runs.pause(run.id)
    assert [event.type for event in seen[-2:]] == ["state", "state"]


async def test_a_paused_run_can_be_cancelled(service: Service) -> None:
    run = await service.runs.start()
    service.runs.pause(run.id)
    async for event in service.runs.events(run.id):
        if event.type == "state" and event.state is RunState.PAUSED:
            break
    assert (await service.runs.cancel(run.id)).state is RunState.CANCELLED


async def test_a_run_that_is_paused_in_its_last_view_rests_before_it_computes(service: Service) -> None:
    run = await service.runs.start()
    seen: list[RunEvent] = []
    async for event in service.runs.events(run.id):
        seen.append(event)
        if event.type == "moving" and event.position == event.of:
            service.runs.pause(run.id)
        if event.type == "state" and event.state is RunState.PAUSED:
            assert len(of(seen, "view")) == 10
            assert not of(seen, "solving")
            await service.runs.resume(run.id)
    assert [event.state for event in of(seen, "state")] == ["running", "paused", "running"]
    assert (await service.runs.get(run.id)).state is RunState.SUCCEEDED


async def test_a_run_that_computes_is_not_paused(
    service: Service, client: httpx.AsyncClient, solver: threading.Event
) -> None:
    solver.clear()

    async def refused() -> None:
        answer = await client.post(f"/runs/{run.id}/pause")
        assert (answer.status_code, answer.json()["code"]) == (409, "run_state")
        assert answer.json()["detail"] == f"run '{run.id}' only computes by now: wait for it, or cancel it"

    run = await service.runs.start()
    async for event in service.runs.events(run.id):
        if event.type == "solving":
            await refused()
            break
    solver.set()
    await service.runs.wait(run.id)
    solver.clear()
    await service.runs.solve(run.id)
    await refused()
    solver.set()
    await service.runs.wait(run.id)
