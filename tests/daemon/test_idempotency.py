"""A request with a key is carried out once: its answers, its refusals, and what a restart leaves of it."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import timedelta
from pathlib import Path

import httpx
import pytest

from daemon import idempotency
from daemon.api import create_app
from daemon.errors import StoreError
from daemon.profile import Profile
from daemon.service import Service, running_service
from tests.daemon.motions import home_all

KEY = {"Idempotency-Key": '"8e03978e-40d5-43dd-bc93-6894a57f9324"'}


@asynccontextmanager
async def serving(profile: Profile, data: Path) -> AsyncIterator[tuple[Service, httpx.AsyncClient]]:
    async with (
        running_service(profile, data) as service,
        httpx.AsyncClient(
            transport=httpx.ASGITransport(create_app(service)), base_url="http://localhost/api/v1"
        ) as client,
    ):
        yield service, client


def code(answer: httpx.Response) -> tuple[int, str]:
    return answer.status_code, answer.json()["code"]


async def take_lease(client: httpx.AsyncClient) -> dict[str, str]:
    return {"X-Lease": (await client.post("/lease", json={"owner": "anna", "ttl_s": 60})).json()["token"]}


async def test_the_same_request_is_answered_as_the_first_time(client: httpx.AsyncClient) -> None:
    first = await client.post("/lease", json={"owner": "anna"}, headers=KEY)
    again = await client.post("/lease", json={"owner": "anna"}, headers=KEY)
    assert (again.status_code, again.content) == (first.status_code, first.content)
    assert again.headers["content-type"] == first.headers["content-type"]
    assert "idempotency-replayed" not in first.headers
    assert again.headers["idempotency-replayed"] == "true"
    bare = {"Idempotency-Key": KEY["Idempotency-Key"].strip('"')}
    assert (await client.post("/lease", json={"owner": "anna"}, headers=bare)).content == first.content


async def test_a_motion_is_not_repeated(service: Service, client: httpx.AsyncClient) -> None:
    await home_all(service.rig)
    headers = KEY | await take_lease(client)
    for _ in range(3):
        jogged = await client.post(
            "/axes/pan/jog", params={"wait": True}, json={"distance": 2}, headers=headers
        )
        assert (jogged.status_code, jogged.json()["position"]) == (200, 2.0)
    assert service.rig.axis("pan").position == 2.0


async def test_another_request_is_refused(service: Service, client: httpx.AsyncClient) -> None:
    headers = KEY | await take_lease(client)
    first = await client.post("/axes/pan/jog", json={"distance": 2}, headers=headers)
    assert first.status_code == 202
    others = [
        client.post("/axes/pan/jog", json={"distance": 3}, headers=headers),
        client.post("/axes/slide/jog", json={"distance": 2}, headers=headers),
        client.post("/axes/pan/jog", params={"wait": True}, json={"distance": 2}, headers=headers),
        client.post("/axes/pan/jog", json={"distance": 2}, headers=headers | {"X-Lease": "another"}),
    ]
    for other in others:
        assert code(await other) == (422, "idempotency_conflict")


async def test_a_request_under_way_is_not_begun_again(
    service: Service, client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    await home_all(service.rig)
    under_way, over, ended = asyncio.Event(), asyncio.Event(), service.motions.ended

    async def ended_late(motion: asyncio.Task[None]) -> None:
        under_way.set()
        await over.wait()
        await ended(motion)

    monkeypatch.setattr(service.motions, "ended", ended_late)
    headers = KEY | await take_lease(client)

    async def move() -> httpx.Response:
        return await client.post(
            "/axes/pan/move", params={"wait": True}, json={"target": 20}, headers=headers
        )

    first = asyncio.create_task(move())
    await under_way.wait()
    assert code(await move()) == (409, "idempotency_in_progress")
    over.set()
    assert (await first).status_code == 200
    assert (await move()).content == (await first).content


async def test_what_was_refused_stays_refused_under_its_key(
    service: Service, client: httpx.AsyncClient
) -> None:
    headers = await take_lease(client)
    refused = await client.post("/axes/pan/move", json={"target": 1}, headers=headers | KEY)
    assert code(refused) == (409, "not_homed")
    await home_all(service.rig)
    assert code(await client.post("/axes/pan/move", json={"target": 1}, headers=headers | KEY)) == (
        409,
        "not_homed",
    )
    assert (await client.post("/axes/pan/move", json={"target": 1}, headers=headers)).status_code == 202


@pytest.mark.parametrize("key", ["", "two words", '"unclosed', "k" * 201, "größe"])
async def test_what_is_no_key_is_refused(client: httpx.AsyncClient, key: str) -> None:
    headers = {"Idempotency-Key": key.encode("latin-1")}
    refused = await client.post("/lease", json={"owner": "anna"}, headers=headers)
    assert code(refused) == (422, "invalid_request")
    assert "Idempotency-Key" in refused.json()["errors"][0]["field"]


async def test_a_stop_is_carried_out_each_time(service: Service, client: httpx.AsyncClient) -> None:
    """A key must never keep a stop from the axes."""
    for _ in range(2):
        assert (await client.post("/stop", headers=KEY)).json()["latched"]
        service.rig.acknowledge_stop()


async def test_a_late_acknowledgement_does_not_free_a_later_stop(
    service: Service, client: httpx.AsyncClient
) -> None:
    await client.post("/stop")
    assert not (await client.post("/stop/acknowledge", headers=KEY)).json()["latched"]
    await client.post("/stop")
    assert not (await client.post("/stop/acknowledge", headers=KEY)).json()["latched"]
    assert service.rig.latch.engaged


async def test_a_run_is_not_begun_again_after_a_restart(profile: Profile, tmp_path: Path) -> None:
    async with serving(profile, tmp_path / "data") as (_, client):
        first = await client.post("/runs", json={"owner": "anna"}, headers=KEY)
        assert first.status_code == 202
        lease = await client.post("/lease", headers={"Idempotency-Key": "lease"}, json={"owner": "ben"})
        assert code(lease) == (409, "lease_held")
    async with serving(profile, tmp_path / "data") as (_, client):
        again = await client.post("/runs", json={"owner": "anna"}, headers=KEY)
        assert (again.status_code, again.content) == (first.status_code, first.content)
        assert again.headers["location"] == first.headers["location"]
        assert again.headers["idempotency-replayed"] == "true"
        assert len((await client.get("/runs")).json()) == 1
        assert code(await client.post("/runs", json={"owner": "ben"}, headers=KEY)) == (
            422,
            "idempotency_conflict",
        )
        free = await client.post("/lease", headers={"Idempotency-Key": "lease"}, json={"owner": "ben"})
        assert free.status_code == 200


async def test_a_request_that_a_kill_cut_off_is_said_to_be(profile: Profile, tmp_path: Path) -> None:
    async with serving(profile, tmp_path / "data") as (service, client):

        async def killed(*_: object) -> None:
            raise asyncio.CancelledError

        service.runs.start = killed  # type: ignore[assignment]
        with pytest.raises(asyncio.CancelledError):
            await client.post("/runs", json={}, headers=KEY)
        assert code(await client.post("/runs", json={}, headers=KEY)) == (409, "idempotency_unknown")
    async with serving(profile, tmp_path / "data") as (service, client):
        assert code(await client.post("/runs", json={}, headers=KEY)) == (409, "idempotency_unknown")
        assert service.runs.active is None


async def test_nothing_is_begun_that_could_not_be_remembered(
    service: Service, client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def full(*_: object) -> None:
        raise StoreError("the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(service.store.answers, "add", full)
        assert code(await client.post("/runs", json={}, headers=KEY)) == (503, "store_unavailable")
    assert service.runs.active is None
    assert (await client.post("/runs", json={}, headers=KEY)).status_code == 202


async def test_the_oldest_are_forgotten_first(
    service: Service, client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(idempotency, "MOST", 2)
    replayed = {}
    for key in ("a", "b", "c", "b", "a"):
        answer = await client.post("/stop/acknowledge", headers={"Idempotency-Key": key})
        replayed[key] = "idempotency-replayed" in answer.headers
    assert replayed == {"a": False, "b": True, "c": False}


async def test_a_key_expires(profile: Profile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with serving(profile, tmp_path / "data") as (service, client):
        first = (await client.post("/runs", json={}, headers=KEY)).json()
        monkeypatch.setattr(idempotency, "LIFETIME", timedelta(0))
        assert code(await client.post("/runs", json={}, headers=KEY)) == (409, "run_active")
    async with serving(profile, tmp_path / "data") as (service, client):
        assert not await service.store.answers.read(service.started_at - timedelta(days=1))
        second = (await client.post("/runs", json={}, headers=KEY)).json()
        assert second["id"] != first["id"]
