"""Moving by hand over HTTP: who may, what is refused, and what stops it."""

import asyncio
from collections.abc import AsyncIterator
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import pytest

from daemon.errors import LeaseEndedError
from daemon.profile import Profile
from daemon.service import Service
from tests.daemon.motions import home_all, until
from tests.daemon.rigs import small_rig

MOTIONS: list[tuple[str, dict[str, Any] | None]] = [
    ("/axes/pan/home", None),
    ("/axes/pan/move", {"target": 1.0}),
    ("/axes/pan/jog", {"distance": 1.0}),
    ("/axes/move", {"targets": {"pan": 1.0}}),
]


@pytest.fixture
async def lease(client: httpx.AsyncClient) -> dict[str, str]:
    """The header of a lease."""
    answer = await client.post("/lease", json={"owner": "anna", "note": "a test", "ttl_s": 60})
    assert answer.status_code == 200
    return {"X-Lease": answer.json()["token"]}


def code(answer: httpx.Response) -> tuple[int, str]:
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert problem["status"] == answer.status_code
    assert problem["instance"] == answer.request.url.path
    assert problem["type"] == f"urn:activecam:problem:{problem['code']}"
    return answer.status_code, problem["code"]


@pytest.mark.parametrize(("address", "body"), MOTIONS)
async def test_nothing_moves_without_the_lease(
    service: Service, client: httpx.AsyncClient, address: str, body: dict[str, Any] | None
) -> None:
    await home_all(service.rig)
    assert code(await client.post(address, json=body)) == (401, "lease_required")
    assert code(await client.post(address, json=body, headers={"X-Lease": "old"})) == (403, "lease_ended")
    await client.post("/lease", json={"owner": "ben"})
    refused = await client.post(address, json=body, headers={"X-Lease": "old"})
    assert code(refused) == (409, "lease_held")
    assert "'ben'" in refused.json()["detail"]
    assert service.rig.snapshot.readings == (0.0, 0.0)
    assert not service.rig.snapshot.moving


async def test_nothing_begins_under_a_lease_that_has_ended_meanwhile(service: Service) -> None:
    lease = service.leases.acquire("anna", "", 60)
    service.leases.release(lease.token)
    with pytest.raises(LeaseEndedError):
        await service.motions.begin(lease, ["pan"], partial(service.rig.jog, "pan", 1.0))
    assert not service.rig.snapshot.moving


async def test_a_lease_is_taken_renewed_and_given_back(client: httpx.AsyncClient) -> None:
    mine = (await client.post("/lease", json={"owner": "anna", "ttl_s": 60})).json()
    assert code(await client.post("/lease", json={"owner": "ben"})) == (409, "lease_held")
    header = {"X-Lease": mine["token"]}
    again = (await client.post("/lease", json={"owner": "anna", "ttl_s": 600}, headers=header)).json()
    assert again["token"] == mine["token"]
    assert again["expires_at"] > mine["expires_at"]
    rig = (await client.get("/rig")).json()
    assert rig["lease"]["owner"] == "anna"
    assert "token" not in rig["lease"]
    assert (await client.delete("/lease", headers=header)).status_code == 204
    assert (await client.get("/rig")).json()["lease"] is None
    assert code(await client.delete("/lease", headers=header)) == (403, "lease_ended")


async def test_an_axis_is_homed_moved_and_jogged(client: httpx.AsyncClient, lease: dict[str, str]) -> None:
    wait = {"wait": "true"}
    assert code(await client.post("/axes/pan/move", json={"target": 1}, headers=lease)) == (409, "not_homed")
    homed = await client.post("/axes/pan/home", params=wait, headers=lease)
    assert (homed.status_code, homed.json()["homed"], homed.json()["position"]) == (200, True, 0.0)
    moved = await client.post("/axes/pan/move", json={"target": 5}, params=wait, headers=lease)
    assert (moved.status_code, moved.json()["position"]) == (200, 5.0)
    jogged = await client.post("/axes/pan/jog", json={"distance": -2}, params=wait, headers=lease)
    assert (jogged.status_code, jogged.json()["position"], jogged.json()["moving"]) == (200, 3.0, False)
    await client.post("/axes/slide/home", params=wait, headers=lease)
    both = {"targets": {"slide": 2, "pan": 0}}
    combined = await client.post("/axes/move", json=both, params=wait, headers=lease)
    assert [axis["position"] for axis in combined.json()] == [2.0, 0.0]


async def test_what_cannot_be_is_refused(
    service: Service, client: httpx.AsyncClient, lease: dict[str, str]
) -> None:
    await home_all(service.rig)
    move = "/axes/pan/move"
    beyond = await client.post(move, json={"target": 20.1}, headers=lease)
    assert code(beyond) == (422, "limit_exceeded")
    assert "its limits are -20 to 20 deg" in beyond.json()["detail"]
    jog = await client.post("/axes/pan/jog", json={"distance": 20.1}, headers=lease)
    assert code(jog) == (422, "limit_exceeded")
    both = await client.post("/axes/move", json={"targets": {"slide": 5, "pan": 99}}, headers=lease)
    assert code(both) == (422, "limit_exceeded")
    assert code(await client.post("/axes/tilt/home", headers=lease)) == (404, "unknown_axis")
    assert code(await client.post("/axes/tilt/stop")) == (404, "unknown_axis")
    wrong = await client.post(move, json={"target": "far"}, headers=lease)
    assert code(wrong) == (422, "invalid_request")
    assert wrong.json()["errors"][0]["field"] == "body.target"
    not_json = await client.post(
        move, content=b'{"target": ', headers=lease | {"Content-Type": "application/json"}
    )
    assert code(not_json) == (422, "invalid_request")
    infinite = await client.post(
        move, content=b'{"target": NaN}', headers=lease | {"Content-Type": "application/json"}
    )
    assert code(infinite) == (422, "invalid_request")
    for almost in ({"target": True}, {"target": "1"}, {"target": 1, "velocity": 0.1}):
        assert code(await client.post(move, json=almost, headers=lease)) == (422, "invalid_request")
    assert service.rig.snapshot.readings == (0.0, 0.0)


class TestASlowRig:
    """Motions that are still under way when something happens."""

    @pytest.fixture
    def profile(self, tmp_path: Path) -> Profile:
        return small_rig(tmp_path, time_scale=1.0, velocity=20.0)

    @pytest.fixture
    async def moving(
        self, service: Service, client: httpx.AsyncClient, lease: dict[str, str]
    ) -> AsyncIterator[Service]:
        await home_all(service.rig)
        begun = await client.post("/axes/slide/move", json={"target": 100}, headers=lease)
        assert begun.status_code == 202
        assert begun.json()["moving"] is True
        yield service
        assert (service.rig.axis("slide").position or 0.0) < 100.0

    async def stands(self, service: Service) -> bool:
        first = await service.rig.fresh_snapshot(service.rig.clock.now())
        second = await service.rig.fresh_snapshot(service.rig.clock.now())
        return not first.moving and first.readings == second.readings

    async def test_a_busy_axis_refuses_and_stops_without_a_lease(
        self, moving: Service, client: httpx.AsyncClient, lease: dict[str, str]
    ) -> None:
        again = await client.post("/axes/slide/move", json={"target": 1}, headers=lease)
        assert code(again) == (409, "axis_busy")
        stopped = await client.post("/axes/slide/stop")
        assert (stopped.status_code, stopped.json()["moving"]) == (200, False)
        assert await self.stands(moving)
        assert "stopped" in stopped.json()["last_error"]

    async def test_of_motions_asked_for_at_the_same_instant_one_begins(
        self, service: Service, client: httpx.AsyncClient, lease: dict[str, str]
    ) -> None:
        await home_all(service.rig)
        asked = [
            client.post("/axes/slide/move", json={"target": target}, headers=lease) for target in (80, 90)
        ]
        answers = await asyncio.gather(*asked)
        assert sorted(answer.status_code for answer in answers) == [202, 409]
        assert next(answer for answer in answers if answer.is_error).json()["code"] == "axis_busy"

    async def test_the_stop_latches_until_it_is_acknowledged(
        self, moving: Service, client: httpx.AsyncClient, lease: dict[str, str]
    ) -> None:
        stopped = await client.post("/stop")
        assert stopped.status_code == 200
        assert stopped.json()["latched"] is True
        assert await self.stands(moving)
        for address, body in MOTIONS:
            assert code(await client.post(address, json=body, headers=lease)) == (409, "stop_latched")
        assert code(await client.post("/runs", json={}, headers=lease)) == (409, "stop_latched")
        assert (await client.get("/rig")).json()["stop"]["latched"] is True
        free = await client.post("/stop/acknowledge")
        assert free.json() == {"latched": False, "reason": None, "since": None}
        moved = await client.post(
            "/axes/pan/move", json={"target": 1}, params={"wait": "true"}, headers=lease
        )
        assert moved.json()["position"] == 1.0

    async def test_it_ends_when_the_lease_is_given_back(
        self, moving: Service, client: httpx.AsyncClient, lease: dict[str, str]
    ) -> None:
        await client.delete("/lease", headers=lease)
        await until(moving.rig, lambda snapshot: not snapshot.moving)
        assert await self.stands(moving)

    async def test_it_ends_when_the_client_is_not_heard_of_any_more(
        self, moving: Service, client: httpx.AsyncClient, lease: dict[str, str]
    ) -> None:
        short = await client.post("/lease", json={"owner": "anna", "ttl_s": 0.1}, headers=lease)
        assert short.status_code == 200
        await until(moving.rig, lambda snapshot: not snapshot.moving)
        assert await self.stands(moving)
        assert moving.leases.current is None

    async def test_who_waits_for_it_is_told_that_the_lease_ended(
        self, service: Service, client: httpx.AsyncClient, lease: dict[str, str]
    ) -> None:
        await home_all(service.rig)
        waiting = asyncio.create_task(
            client.post("/axes/slide/jog", json={"distance": 90}, params={"wait": "true"}, headers=lease)
        )
        await until(service.rig, lambda snapshot: snapshot.moving)
        await client.delete("/lease", headers=lease)
        assert code(await waiting) == (409, "motion_stopped")
        assert await self.stands(service)

    async def test_who_waits_for_it_is_told_that_it_was_stopped(
        self, service: Service, client: httpx.AsyncClient, lease: dict[str, str]
    ) -> None:
        await home_all(service.rig)
        waiting = asyncio.create_task(
            client.post("/axes/slide/move", json={"target": 100}, params={"wait": "true"}, headers=lease)
        )
        await until(service.rig, lambda snapshot: snapshot.moving)
        await client.post("/stop")
        assert code(await waiting) == (409, "motion_stopped")
