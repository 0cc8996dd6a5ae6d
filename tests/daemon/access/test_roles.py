"""With each role and with none, over every route: what is refused has no effect."""

import json
from collections.abc import Iterator
from typing import Any, cast

import httpx
import pytest
from starlette.routing import BaseRoute, Route, WebSocketRoute
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from daemon.access.roles import Role
from daemon.api import create_app
from daemon.api.rules import PREFIX, ROLES, ROLES_AT_ROOT, Rules
from daemon.service import Service
from tests.daemon.access.keys import bearer

ALL = {f"{method} {PREFIX}{path}": role for name, role in ROLES.items() for method, path in [name.split()]}
ALL |= ROLES_AT_ROOT

BODIES: dict[str, dict[str, Any]] = {
    "POST /api/v1/lease": {"owner": "eve"},
    "POST /api/v1/axes/move": {"targets": {"pan": 1.0}},
    "POST /api/v1/axes/{name}/move": {"target": 1.0},
    "POST /api/v1/axes/{name}/jog": {"distance": 1.0},
    "POST /api/v1/pose": {"readings": [[1.0, 2.0]]},
    "POST /api/v1/project": {"points": [[0.0, 0.0, 0.0]]},
    "POST /api/v1/rays": {"pixels": [[0.0, 0.0]]},
}


def served(routes: list[BaseRoute], prefix: str = "") -> Iterator[str]:
    """Every route that there is, by its methods and path."""
    for route in routes:
        if isinstance(route, WebSocketRoute):
            yield f"WS {prefix}{route.path}"
        elif isinstance(route, Route):
            # What answers GET answers HEAD without a body, if it does.
            yield from (f"{method} {prefix}{route.path}" for method in (route.methods or set()) - {"HEAD"})
        else:  # a router inside the app's, which FastAPI keeps as one since 0.137
            inner = cast(Any, route)
            yield from served(inner.original_router.routes, prefix + inner.include_context.prefix)


def test_every_route_has_a_role_and_every_role_a_route() -> None:
    found = list(served(create_app(cast(Service, None)).routes))
    assert sorted(found) == sorted(ALL)


def test_a_route_without_a_role_is_not_served() -> None:
    rules = Rules({"GET /pose": Role.VIEWER, "POST /axes/{name}/stop": Role.OPERATOR}, {})
    assert rules.find("GET", "/api/v1/pose") is not None
    for method, path in (
        ("GET", "/api/v1/rig"),
        ("POST", "/api/v1/pose"),
        ("WS", "/api/v1/pose"),
        ("GET", "/pose"),
    ):
        assert rules.find(method, path) is None
    assert rules.find("POST", "/api/v1/axes/a/b/stop") is None
    assert rules.methods("/api/v1/axes/pan/stop") == ["POST"]


def test_a_role_may_what_those_before_it_may() -> None:
    assert [[role.includes(other) for other in Role] for role in Role] == [
        [True, False, False],
        [True, True, False],
        [True, True, True],
    ]


async def outcome(http: httpx.AsyncClient, route: str, headers: dict[str, str]) -> tuple[int, str | None]:
    """Ask, and return the status and the problem's code, if there is one."""
    method, path = route.split()
    path = path.replace("{name}", "pan").replace("{run_id}", "none").replace("{calibration_id}", "none")
    url = http.base_url.join(path)
    if method == "WS":
        try:
            async with connect(str(url.copy_with(scheme="ws")), additional_headers=headers) as stream:
                await stream.recv()
        except InvalidStatus as refused:
            return refused.response.status_code, json.loads(refused.response.body or b"")["code"]
        return 101, None
    async with http.stream(method, url, headers=headers, json=BODIES.get(route)) as answer:
        if answer.headers.get("content-type") != "application/problem+json":
            return answer.status_code, None
        code = json.loads(await answer.aread())["code"]
        if answer.status_code == 401 and code != "lease_required":
            assert answer.headers["www-authenticate"] == "Bearer"
        return answer.status_code, code


async def state(service: Service) -> tuple[object, ...]:
    return (
        service.leases.current,
        service.rig.latch.engaged,
        service.rig.snapshot.moving,
        [axis.homed for axis in service.rig.snapshot.axes],
        await service.runs.list(),
        service.poses.calibration_id,
        await service.access.book.read(),
        await service.store.keys.all(),
    )


@pytest.mark.parametrize("role", [None, *Role])
async def test_what_a_role_may_not_has_no_effect(
    guarded: Service, http: httpx.AsyncClient, secrets: dict[Role, str], role: Role | None
) -> None:
    headers = {} if role is None else bearer(secrets[role])
    before = await state(guarded)
    for route, needed in ALL.items():
        if needed is None or (role is not None and role.includes(needed)):
            continue
        expected = (401, "key_required") if role is None else (403, "role_required")
        assert await outcome(http, route, headers) == expected, route
    assert await state(guarded) == before


@pytest.mark.parametrize("role", [None, *Role])
async def test_what_a_role_may_is_let_through(
    http: httpx.AsyncClient, secrets: dict[Role, str], role: Role | None
) -> None:
    headers = {} if role is None else bearer(secrets[role])
    for route, needed in ALL.items():
        if needed is None or (role is not None and role.includes(needed)):
            status, code = await outcome(http, route, headers)
            assert status < 500, route
            assert code not in {
                "key_required",
                "key_unknown",
                "role_required",
                "not_found",
                "method_not_allowed",
            }, route


@pytest.mark.parametrize(
    "authorization",
    ["Bearer", "Bearer activecam_guess", "Basic dTpw", "Lease x", "", "Bearer \xe9"],
)
async def test_what_is_no_key_is_none(http: httpx.AsyncClient, authorization: str) -> None:
    answer = await http.get("/rig", headers={"Authorization": authorization.encode("latin-1")})  # type: ignore[dict-item]
    assert (answer.status_code, answer.json()["code"]) == (401, "key_unknown")


@pytest.mark.parametrize("path", ["/nothing", "/rig/", "//rig", "/axes/pan/%2e%2e/stop", "/RIG", "/stop%00"])
async def test_whoever_is_not_known_is_not_told_what_there_is(
    http: httpx.AsyncClient, secrets: dict[Role, str], path: str
) -> None:
    for method in ("GET", "POST", "PATCH"):
        answer = await http.request(method, path)
        assert (answer.status_code, answer.json()["code"]) == (401, "key_required")
        answer = await http.request(method, path, headers=bearer(secrets[Role.VIEWER]))
        assert (answer.status_code, answer.json()["code"]) == (404, "not_found")


async def test_health_says_nothing_of_the_rig_to_strangers(
    http: httpx.AsyncClient, secrets: dict[Role, str]
) -> None:
    stranger = {"status": "ok", "version": None, "started_at": None, "problems": None}
    assert (await http.get("/health")).json() == stranger
    assert (await http.get("/health", headers=bearer("guess"))).json() == stranger
    known = (await http.get("/health", headers=bearer(secrets[Role.VIEWER]))).json()
    assert known["problems"] == []


async def test_on_this_machine_nobody_is_asked(client: httpx.AsyncClient) -> None:
    assert (await client.get("/session")).json() == {
        "key": None,
        "role": "admin",
        "may": ["read", "move", "audit"],
    }
    answer = await client.post("/session", headers=bearer("anything"))
    assert answer.status_code == 200
    assert "set-cookie" not in answer.headers
    assert (await client.get("/audit")).status_code == 200
