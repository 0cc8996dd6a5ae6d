"""With each role and with none, over every route: what is refused has no effect."""

import itertools
from collections.abc import Iterator
from typing import Any, cast

import httpx
import pytest
from starlette.routing import BaseRoute, Route, WebSocketRoute

from daemon.access.roles import Role
from daemon.api import create_app
from daemon.api.rules import Rules
from daemon.service import Service
from tests.daemon.access.asking import outcome, status_of
from tests.daemon.access.commands import ALL
from tests.daemon.access.keys import bearer


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


def test_whoever_is_no_operator_may_only_read() -> None:
    others = {route for route, role in ALL.items() if role in {None, Role.VIEWER}}
    assert {route.replace("/api/v1", "") for route in others if not route.startswith("GET ")} == {
        "POST /pose",
        "POST /project",
        "POST /rays",
        "WS /pose/stream",
        "WS /camera/live",
        "WS /live",  # whose commands are requests of their own
        "POST /session",
        "DELETE /session",
    }


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
    for route, needed in sorted(
        ALL.items(), key=lambda item: item[0] == "POST /api/v1/runs"
    ):  # which takes long
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


async def test_no_way_of_writing_an_address_gets_past_a_role(
    guarded: Service, address: str, secrets: dict[Role, str]
) -> None:
    before = await state(guarded)
    disguised = {
        "X-HTTP-Method-Override": "POST",
        "X-Original-URL": "/api/v1/stop",
        "X-Forwarded-Prefix": "/api/v1",
    }
    for asked, expected in {
        "POST /api/v1/%73top": 403,
        "POST /api/v1%2Fstop": 403,
        "POST /api/v1/axes%2Fpan/home": 403,
        "POST /api/v1/stop?role=admin": 403,
        "POST /api/v1/stop/": 404,
        "POST /api/v1//stop": 404,
        "POST /api/v1/./stop": 404,
        "POST /api/v1/pose/../stop": 404,
        "POST /api/v1/stop;pose": 404,
        "POST /api/v1/Stop": 404,
        "POST http://localhost/api/v1/stop": 404,
        "GET /api/v1/stop": 405,
        "PUT /api/v1/stop": 405,
        "post /api/v1/stop": 405,
        "GET /api/v1/pose": 409,  # nothing is calibrated
    }.items():
        status = await status_of(address, asked, bearer(secrets[Role.VIEWER]) | disguised)
        assert status == expected, asked
    assert await state(guarded) == before


async def test_what_is_no_key_is_none(http: httpx.AsyncClient) -> None:
    for shown in (b"Bearer", b"Bearer activecam_guess", b"Basic dTpw", b"Lease x", b"", b"Bearer \xe9"):
        answer = await http.get("/rig", headers=[(b"Authorization", shown)])
        assert (answer.status_code, answer.json()["code"]) == (401, "key_unknown"), shown


async def test_what_is_refused_writes_no_line_of_its_own_in_the_log(
    http: httpx.AsyncClient, caplog: pytest.LogCaptureFixture
) -> None:
    await http.get("/rig%0AWARNING%20all%20is%20well", headers=bearer("guess"))
    [refused] = [record.getMessage() for record in caplog.records if record.name == "daemon.api.gate"]
    assert refused.startswith(
        "/api/v1/rig%0AWARNING%20all%20is%20well was refused to 127.0.0.1: this key is not known"
    )


async def test_whoever_is_not_known_is_not_told_what_there_is(
    http: httpx.AsyncClient, secrets: dict[Role, str]
) -> None:
    paths = ("/nothing", "/rig/", "//rig", "/axes/pan/%2e%2e/stop", "/RIG", "/stop%00")
    for method, path in itertools.product(("GET", "POST", "PATCH"), paths):
        answer = await http.request(method, path)
        assert (answer.status_code, answer.json()["code"]) == (401, "key_required"), path
        answer = await http.request(method, path, headers=bearer(secrets[Role.VIEWER]))
        assert (answer.status_code, answer.json()["code"]) == (404, "not_found"), path


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
