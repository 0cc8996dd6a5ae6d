"""A lease is taken over by an explicit act, which stops what its holder has in motion, and is written down."""

import asyncio
from pathlib import Path

import httpx
import pytest

from daemon.errors import LeaseHeldError
from daemon.lease import LeaseDesk
from daemon.profile import Profile
from daemon.service import Service
from tests.daemon.rigs import small_rig


@pytest.fixture
def profile(tmp_path: Path) -> Profile:
    """A rig that is slow enough to be met on its way."""
    return small_rig(tmp_path, velocity=0.3)


async def test_it_stops_what_the_former_holder_has_in_motion(
    service: Service, client: httpx.AsyncClient
) -> None:
    anna = (await client.post("/lease", json={"owner": "anna"})).json()
    await service.rig.home("slide")
    shown = {"X-Lease": anna["token"]}
    asked = client.post("/axes/slide/move?wait=true", json={"target": 95}, headers=shown)
    move = asyncio.create_task(asked)
    while not service.rig.axis("slide").moving:
        await service.rig.changed.wait()
    refused = await client.post("/lease", json={"owner": "ben"})
    assert (refused.status_code, refused.json()["code"]) == (409, "lease_held")
    assert service.rig.axis("slide").moving
    ben = await client.post("/lease", json={"owner": "ben", "note": "she has left", "take_over": True})
    assert ben.status_code == 200
    assert not service.rig.axis("slide").moving
    assert (await move).json()["code"] == "motion_stopped"
    late = await client.post("/axes/slide/move", json={"target": 5}, headers=shown)
    assert (late.status_code, late.json()["code"]) == (409, "lease_held")
    assert "'ben' (she has left)" in late.json()["detail"]
    mine = await client.post(
        "/axes/slide/move?wait=true", json={"target": 5}, headers={"X-Lease": ben.json()["token"]}
    )
    assert mine.status_code == 200
    written = [
        each["asked"] for each in (await client.get("/audit")).json() if each["path"] == "/api/v1/lease"
    ]
    assert '"take_over":true' in written[0]


async def test_a_runs_lease_ends_with_the_run_alone(service: Service, client: httpx.AsyncClient) -> None:
    run = (await client.post("/runs", json={})).json()["id"]
    answer = await client.post("/lease", json={"owner": "ben", "take_over": True})
    assert (answer.status_code, answer.json()["code"]) == (409, "lease_held")
    assert f"'run {run}' holds the motion lease until it is over: cancel it first" in answer.json()["detail"]
    assert service.runs.active is not None
    await client.post(f"/runs/{run}/cancel")
    assert (await client.post("/lease", json={"owner": "ben", "take_over": True})).status_code == 200


async def test_ones_own_can_be_taken_over_too() -> None:
    desk = LeaseDesk()
    first = desk.acquire("anna", "", 60)
    second, former = desk.take_over("anna", "", 60)
    assert former == first
    assert second.token != first.token
    with pytest.raises(LeaseHeldError):
        desk.require(first.token)
    desk.close()
