"""Commands over the page's socket: the same roles, the same audit log, and keys that may be taken back."""

import asyncio
import json
from typing import Any

import httpx
from websockets.asyncio.client import ClientConnection, connect

from daemon.access.roles import Role
from daemon.service import Service
from tests.daemon.access.keys import bearer, close_code


async def ask(socket: ClientConnection, **command: Any) -> dict[str, Any]:
    await socket.send(json.dumps({"id": 1} | command))
    while True:
        found: dict[str, Any] = json.loads(await socket.recv())
        if found["type"] == "answer":
            return found


def live(address: str) -> str:
    return f"{address.replace('http', 'ws')}/api/v1/live"


async def test_a_viewer_is_told_all_and_moves_nothing(
    guarded: Service, address: str, secrets: dict[Role, str]
) -> None:
    commands: list[dict[str, Any]] = [
        {"do": "stop"},
        {"do": "acknowledge"},
        {"do": "lease", "owner": "eve"},
        {"do": "release"},
        {"do": "home", "axis": "pan"},
        {"do": "jog", "axis": "pan", "distance": 1},
        {"do": "move", "targets": {"pan": 1}},
        {"do": "stop_axis", "axis": "pan"},
    ]
    async with connect(live(address), additional_headers=bearer(secrets[Role.VIEWER])) as socket:
        told = json.loads(await socket.recv())
        assert told["you"] == {"key": "viewer", "role": "viewer", "may": ["read"], "holds_lease": False}
        for command in commands:
            answer = await ask(socket, **command)
            assert (answer["status"], answer["problem"]["code"]) == (403, "role_required")
    assert not guarded.rig.latch.engaged
    assert guarded.leases.current is None
    assert await guarded.access.book.read() == []


async def test_commands_are_written_down_with_who_gave_them(
    http: httpx.AsyncClient, address: str, secrets: dict[Role, str]
) -> None:
    async with connect(live(address), additional_headers=bearer(secrets[Role.OPERATOR])) as socket:
        await ask(socket, do="lease", owner="anna")
        await ask(socket, do="lease", owner="anna")  # renewed, which says nothing new
        await ask(socket, do="jog", axis="pan", distance=99)
        await ask(socket, do="stop")
    done = (await http.get("/audit", headers=bearer(secrets[Role.ADMIN]))).json()[::-1]
    assert [(each["who"], each["method"], each["path"], each["status"], each["code"]) for each in done] == [
        ("operator", "POST", "/api/v1/lease", 200, None),
        ("operator", "POST", "/api/v1/axes/pan/jog", 422, "limit_exceeded"),
        ("operator", "POST", "/api/v1/stop", 200, None),
    ]
    assert done[1]["asked"] == '{"distance":99}'
    assert {each["address"] for each in done} == {"127.0.0.1"}


async def test_a_key_that_was_removed_closes_the_socket(
    guarded: Service, address: str, secrets: dict[Role, str]
) -> None:
    async with connect(live(address), additional_headers=bearer(secrets[Role.OPERATOR])) as socket:
        await ask(socket, do="lease", owner="anna")
        await guarded.store.keys.remove("operator")
        async with asyncio.timeout(60):
            assert await close_code(socket) == 1008
            while guarded.leases.current is not None:
                await guarded.rig.changed.wait()
