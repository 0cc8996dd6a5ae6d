"""What may come at the same moment, and is to end as if one had come after the other."""

import asyncio
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import pytest

from daemon.profile import Profile
from daemon.rig import Devices
from daemon.service import Service, running_service
from daemon.store import CalibrationRecord, RunRecord, RunState
from drivers.axis import Axis
from tests.daemon.motions import home_all, to_and_fro
from tests.daemon.snapshots import VERSIONS, restore_snapshot

EARLIER = "1087d24108964e429a2ba048f07a4efa"
"""A calibration of the snapshot, of the rig of these tests."""


@pytest.mark.parametrize("first", ["a person", "the run"])
async def test_a_person_and_a_run_activate_at_once(
    profile: Profile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, first: str
) -> None:
    data = tmp_path / "data"
    data.mkdir()
    restore_snapshot(VERSIONS[-1], data)
    async with running_service(profile, data) as service:
        store, asked = service.store, asyncio.Event()
        activate, change_run, persons = store.activate, store.change_run, []

        async def told(calibration_id: str) -> CalibrationRecord:
            asked.set()
            return await activate(calibration_id)

        async def at_once(run_id: str, state: RunState, *more: Any, **keyed: Any) -> RunRecord:
            if keyed.get("calibration") is None:
                return await change_run(run_id, state, *more, **keyed)
            persons.append(asyncio.create_task(service.activate(EARLIER)))
            if first == "a person":
                await asked.wait()
            return await change_run(run_id, state, *more, **keyed)

        monkeypatch.setattr(store, "activate", told)
        monkeypatch.setattr(store, "change_run", at_once)
        run = await service.runs.wait((await service.runs.start()).id)
        await asyncio.gather(*persons)
        assert len(persons) == 1
        assert run.state is RunState.SUCCEEDED
        used = service.poses.calibration_id
        assert used == (await store.active_and_earlier())[0]
        assert used == (run.calibration_id if first == "a person" else EARLIER)


async def test_who_acknowledges_a_stop_while_the_daemon_ends_moves_nothing(
    service: Service, client: httpx.AsyncClient
) -> None:
    await home_all(service.rig)
    lease = service.leases.acquire("anna", "", 60.0)
    await service.motions.begin(lease, ["slide"], to_and_fro(service.rig, "slide"))
    engaged = asyncio.Event()
    service.rig.latch.on_engage(lambda _: engaged.set())
    ending = asyncio.create_task(service.halt())
    await engaged.wait()
    assert not ending.done()
    assert (await client.post("/stop/acknowledge")).json()["latched"]
    await ending
    token = (await client.post("/lease", json={"owner": "bert", "note": "", "ttl_s": 60})).json()["token"]
    refused = await client.post("/axes/slide/jog", json={"distance": 1.0}, headers={"X-Lease": token})
    assert refused.json()["code"] == "stop_latched"
    assert not service.rig.snapshot.moving


@pytest.mark.parametrize("waits", range(4))
@pytest.mark.parametrize("turns", range(12))
async def test_nothing_is_sent_once_the_lease_has_ended(
    service: Service, devices: Devices, monkeypatch: pytest.MonkeyPatch, turns: int, waits: int
) -> None:
    """However far the motion has come by then; a driver may still wait for its port."""
    await home_all(service.rig)
    sent: list[float] = []

    def noted(axis: Axis) -> Callable[[float], Awaitable[None]]:
        move = axis.move

        async def noting(target: float) -> None:
            for _ in range(waits):
                await asyncio.sleep(0)
            sent.append(target)
            await move(target)

        return noting

    for controller in devices.controllers.values():
        for axis in controller.axes.values():
            monkeypatch.setattr(axis, "move", noted(axis))
    lease = service.leases.acquire("anna", "", 60.0)
    move = partial(service.rig.move, {"slide": 90.0, "pan": 9.0})
    beginning = asyncio.create_task(service.motions.begin(lease, ["slide", "pan"], move))
    for _ in range(turns):
        await asyncio.sleep(0)
    service.leases.release(lease.token)
    before = list(sent)
    await asyncio.gather(beginning, service.motions.stopped(lease), return_exceptions=True)
    assert sent == before
    assert not service.rig.snapshot.moving
