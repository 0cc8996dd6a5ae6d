"""Whatever moves, creates, steers or activates is written down with who did it; nobody waits for that."""

import asyncio
import json
import logging
import re
from collections.abc import Collection
from datetime import UTC, datetime
from pathlib import Path

import httpx
import pytest

from daemon.access.book import AuditBook
from daemon.access.entries import AuditEntry
from daemon.access.roles import Role
from daemon.api import create_app
from daemon.api.witness import KEPT
from daemon.cli import main
from daemon.errors import StoreError
from daemon.operation.log_format import TextLines
from daemon.profile import Profile
from daemon.service import Service, running_service
from daemon.store import Store
from daemon.store.audit import StoredAudit
from daemon.store.database import Database
from tests.daemon.access.keys import bearer


def entry(path: str) -> AuditEntry:
    return AuditEntry(datetime.now(UTC), "anna", Role.OPERATOR, "192.0.2.7", "POST", path)


async def test_it_says_who_did_what_and_what_came_of_it(
    http: httpx.AsyncClient, secrets: dict[Role, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("daemon.api.witness.LONG", 60)
    operator, admin = bearer(secrets[Role.OPERATOR]), bearer(secrets[Role.ADMIN])
    lease = (await http.post("/lease", json={"owner": "anna"}, headers=operator)).json()["token"]
    shown = operator | {"X-Lease": lease}
    for _ in range(3):  # renewed, which says nothing new
        assert (await http.post("/lease", json={"owner": "anna"}, headers=shown)).status_code == 200
    await http.post("/axes/pan/home?wait=true", headers=shown)
    await http.post("/axes/pan/move?wait=true", json={"target": 2.5}, headers=shown)
    await http.post("/axes/move", json={"targets": {"pan": 99}}, headers=shown)
    await http.post("/runs/none/cancel", headers=operator)
    await http.post("/stop", headers=bearer(secrets[Role.VIEWER]))
    await http.post("/stop", headers=admin)
    await http.get("/rig", headers=operator)
    await http.post("/pose", json={"readings": [[1, 2]]}, headers=operator)
    answer = await http.get("/audit", headers=admin)
    done = answer.json()[::-1]
    assert [
        (each["who"], each["path"].removeprefix("/api/v1"), each["status"], each["code"]) for each in done
    ] == [
        ("operator", "/lease", 200, None),
        ("operator", "/axes/pan/home", 200, None),
        ("operator", "/axes/pan/move", 200, None),
        ("operator", "/axes/move", 422, "limit_exceeded"),
        ("operator", "/runs/none/cancel", 404, "unknown_run"),
        ("admin", "/stop", 200, None),
    ]
    assert json.loads(done[2]["asked"]) == {"target": 2.5}
    assert json.loads(done[3]["asked"]) == {"targets": {"pan": 99}}
    assert {(each["address"], each["method"]) for each in done} == {("127.0.0.1", "POST")}
    assert {each["role"] for each in done} == {"operator", "admin"}
    assert lease not in answer.text
    assert not any(secret in answer.text for secret in secrets.values())

    page = (await http.get("/audit", params={"limit": 2, "before": done[3]["id"]}, headers=admin)).json()
    assert page == [done[2], done[1]]
    assert (await http.get("/audit?limit=0", headers=admin)).status_code == 422


async def test_the_log_says_who_too(
    http: httpx.AsyncClient, secrets: dict[Role, str], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.handler.setFormatter(TextLines())
    with caplog.at_level(logging.INFO):
        await http.post("/lease", json={"owner": "anna"}, headers=bearer(secrets[Role.OPERATOR]))
    assert re.search(r"'anna' may move .* \[request=\w+ who=operator\]", caplog.text)


async def test_a_renewal_that_fails_is_written(client: httpx.AsyncClient, service: Service) -> None:
    await client.post("/lease", json={"owner": "anna"})
    await client.post("/lease", json={"owner": "eve"}, headers={"X-Lease": "guess"})
    latest = (await client.get("/audit")).json()[0]
    assert (latest["who"], latest["status"], latest["code"]) == (None, 409, "lease_held")


async def test_what_is_answered_again_is_not_written_again(client: httpx.AsyncClient) -> None:
    named = {"Idempotency-Key": "first"}
    for _ in range(3):
        answer = await client.post("/lease", json={"owner": "anna"}, headers=named)
        assert answer.status_code == 200
    assert answer.headers["Idempotency-Replayed"] == "true"
    assert len((await client.get("/audit")).json()) == 1


async def test_of_a_long_body_the_beginning_is_kept(client: httpx.AsyncClient) -> None:
    await client.post("/lease", json={"owner": "anna", "note": "x" * 2 * KEPT})
    [done] = (await client.get("/audit")).json()
    assert done["asked"].startswith('{"owner":"anna","note":"xxx')
    assert len(done["asked"]) == KEPT
    assert done["code"] == "invalid_request"


async def test_what_goes_on_is_written_before_it_ends(
    service: Service, client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    waiting, over = asyncio.Event(), asyncio.Event()

    async def ended(motion: asyncio.Task[None]) -> None:
        waiting.set()
        await over.wait()

    monkeypatch.setattr(service.motions, "ended", ended)
    monkeypatch.setattr("daemon.api.witness.LONG", 0)
    lease = (await client.post("/lease", json={"owner": "anna"})).json()["token"]
    asked = client.post("/axes/slide/jog?wait=true", json={"distance": 1}, headers={"X-Lease": lease})
    jog = asyncio.create_task(asked)
    await waiting.wait()
    first = (await client.get("/audit")).json()[0]
    assert (first["path"], first["asked"], first["status"]) == (
        "/api/v1/axes/slide/jog",
        '{"distance":1}',
        None,
    )
    over.set()
    assert (await jog).status_code == 200
    assert (await client.get("/audit")).json()[0] == first | {"status": 200}


async def test_a_stop_does_not_wait_for_the_disk(
    service: Service, client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, over = asyncio.Event(), asyncio.Event()

    async def stuck(self: StoredAudit, entries: Collection[AuditEntry]) -> None:
        begun.set()
        await over.wait()

    monkeypatch.setattr(StoredAudit, "write", stuck)
    assert (await client.post("/stop/acknowledge")).status_code == 200
    await begun.wait()
    assert (await client.post("/stop")).status_code == 200
    assert service.rig.latch.engaged
    over.set()


async def test_what_a_disk_does_not_take_is_written_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("daemon.access.book.UNWRITTEN", 2)
    store = await Store.open(tmp_path)
    book = AuditBook(store.audit)

    async def full(entries: Collection[AuditEntry]) -> None:
        raise StoreError("database or disk is full")

    with monkeypatch.context() as disk:
        disk.setattr(store.audit, "write", full)
        for path in ("/lost", "/first", "/second"):
            book.note(entry(path))
            with pytest.raises(StoreError):
                await book.write()
    assert "1 entries of the audit log are lost" in caplog.text
    assert [each.path for each in await book.read()] == ["/second", "/first"]
    await store.close()


async def test_the_latest_are_kept(tmp_path: Path) -> None:
    database = await Database.open(tmp_path)
    audit = StoredAudit(database, kept=3)
    entries = [entry(f"/{number}") for number in range(5)]
    await audit.write(entries[:4])
    assert [each.path for each in await audit.read(None, 10)] == ["/3", "/2", "/1"]
    entries[3].status = 200
    await audit.write(entries[3:])
    latest = await audit.read(None, 10)
    assert [(each.path, each.status) for each in latest] == [("/4", None), ("/3", 200), ("/2", None)]
    assert [each.id for each in latest] == [5, 4, 3]
    await database.close()


async def test_it_outlives_the_daemon_and_is_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = await Store.open(tmp_path)
    done = entry("/api/v1/axes/pan/move")
    done.asked, done.status, done.code = '{"target": [bold]9\x1b[2J', 422, "invalid_request"
    await store.audit.write([done, entry("/api/v1/stop")])
    with pytest.raises(SystemExit):  # beside the daemon, which has the folder
        await asyncio.to_thread(main, ["audit", "--data", str(tmp_path)])
    await store.close()
    first, second = [line for line in capsys.readouterr().out.splitlines() if "192.0.2.7" in line]
    assert '{"target": [bold]9\N{REPLACEMENT CHARACTER}[2J' in first
    assert "invalid_request" in first
    assert "unknown" in second


async def test_what_was_done_last_is_written_when_the_daemon_ends(profile: Profile, tmp_path: Path) -> None:
    async with running_service(profile, tmp_path / "data") as service:
        transport = httpx.ASGITransport(create_app(service))
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost/api/v1") as client:
            await client.post("/stop/acknowledge")
    store = await Store.open(tmp_path / "data")
    [done] = await store.audit.read(None, 10)
    assert (done.path, done.status) == ("/api/v1/stop/acknowledge", 200)
    await store.close()
