"""What comes from elsewhere, under another name or in too many bytes, is refused before any route sees it."""

import itertools
import json
from collections.abc import AsyncIterator

import httpx
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from daemon.api import create_app
from daemon.api.guard import LARGEST_BODY
from daemon.server import LARGEST_MESSAGE, Door
from daemon.service import Service
from tests.daemon.access.asking import status_of
from tests.daemon.access.keys import close_code
from tests.daemon.sockets import on_a_socket

LOCAL = "http://localhost"


@pytest.fixture
async def address(service: Service) -> AsyncIterator[str]:
    async with on_a_socket(service, Door(["rig.lab"])) as address:
        yield address


async def test_the_daemon_answers_to_addresses_and_to_its_names(service: Service) -> None:
    own = (
        "localhost",
        "localhost:8080",
        "rig.localhost",
        "127.0.0.1:1",
        "[::1]:8080",
        "192.0.2.7",
        "RIG.lab",
    )
    transport = httpx.ASGITransport(create_app(service, ["Rig.Lab"]))
    async with httpx.AsyncClient(transport=transport, base_url=LOCAL) as client:
        for host in own:
            assert (await client.get("/api/v1/health", headers={"Host": host})).status_code == 200, host


async def test_a_name_that_anybody_could_give_it_is_none_of_its_own(
    service: Service, client: httpx.AsyncClient
) -> None:
    hosts = ("localhost.evil.example", "", "[", "rig", "evil.example", "evil.example:8080")
    asked = (("GET", "/rig"), ("POST", "/lease"), ("GET", "/nothing"))
    for host, (method, path) in itertools.product(hosts, asked):
        answer = await client.request(method, path, headers={"Host": host}, json={"owner": "eve"})
        assert (answer.status_code, answer.json()["code"]) == (421, "host_unknown"), host
    assert "'evil.example'" in answer.json()["detail"]
    assert "--host-name evil.example" in answer.json()["detail"]
    assert service.leases.current is None


async def test_a_page_from_elsewhere_changes_nothing(service: Service, client: httpx.AsyncClient) -> None:
    for origin in ("http://elsewhere.example", "null", "http://localhost:3000", "file://", "http://[", ""):
        answer = await client.post("/lease", headers={"Origin": origin}, json={"owner": "eve"})
        assert (answer.status_code, answer.json()["code"]) == (403, "foreign_page"), origin
        assert service.leases.current is None
        read = await client.get("/rig", headers={"Origin": origin})
        assert "access-control-allow-origin" not in read.headers


async def test_its_own_page_may_change_what_its_user_may(client: httpx.AsyncClient) -> None:
    answer = await client.post("/lease", headers={"Origin": "http://LOCALHOST"}, json={"owner": "anna"})
    assert answer.status_code == 200


async def test_nobody_is_told_that_pages_from_elsewhere_may_ask(client: httpx.AsyncClient) -> None:
    asked = {"Origin": "http://elsewhere.example", "Access-Control-Request-Method": "POST"}
    answer = await client.options("/lease", headers=asked)
    assert answer.status_code == 405
    assert not [name for name in answer.headers if name.startswith("access-control")]


def stream_of(address: str, name: str, origin: str | None = None) -> connect:
    """The pose stream of the daemon at `address`, asked for under `name`, by a page of `origin`."""
    host, _, port = address.removeprefix("http://").partition(":")
    uri = f"ws://{name}:{port}/api/v1/pose/stream"
    return connect(uri, host=host, port=int(port), additional_headers={"Origin": origin} if origin else {})


async def test_a_stream_is_refused_as_a_change_is(address: str) -> None:
    for name, origin, expected in (
        ("rig.lab", "http://elsewhere.example", (403, "foreign_page")),
        ("rig.lab", "null", (403, "foreign_page")),
        ("evil.example", None, (421, "host_unknown")),
        ("evil.example", "http://evil.example", (421, "host_unknown")),
    ):
        with pytest.raises(InvalidStatus) as refused:
            await stream_of(address, name, origin)
        answer = refused.value.response
        assert (answer.status_code, json.loads(answer.body or b"")["code"]) == expected


async def test_a_page_under_the_daemons_name_gets_the_stream(address: str) -> None:
    port = address.rpartition(":")[2]
    async with stream_of(address, "rig.lab", f"http://rig.lab:{port}") as stream:
        assert json.loads(await stream.recv())["code"] == "not_calibrated"


async def test_a_stream_takes_no_large_messages(address: str) -> None:
    async with connect(f"{address.replace('http', 'ws')}/api/v1/pose/stream") as stream:
        await stream.recv()
        await stream.send("x" * (LARGEST_MESSAGE + 1))
        assert await close_code(stream) == 1009


@pytest.mark.parametrize(
    "headers", [{}, {"Content-Length": str(LARGEST_BODY + 1)}], ids=["chunked", "announced"]
)
async def test_a_body_is_taken_up_to_a_size(address: str, headers: dict[str, str]) -> None:
    async def body() -> AsyncIterator[bytes]:
        for _ in range(LARGEST_BODY // 2**20):
            yield b" " * 2**20
        yield b" "

    sent = {"Content-Type": "application/json"} | headers
    async with httpx.AsyncClient(base_url=f"{address}/api/v1", timeout=30) as client:
        answer = await client.post("/pose", content=body(), headers=sent)
        assert (answer.status_code, answer.json()["code"]) == (413, "body_too_large")
        assert (await client.get("/health")).status_code == 200


async def test_an_id_leads_nowhere_but_to_its_record(address: str) -> None:
    paths = (
        "/runs/..%2f..%2fetc%2fpasswd/events",
        "/runs/%2e%2e/events",
        "/runs/%00/events",
        "/runs/a%00b",
        "/runs/%ff%fe",
        "/calibrations/..%2f..%2factivecam.db",
        "/calibrations/%00",
        "/axes/..%2f..%2fstop",
    )
    for path in paths:
        assert await status_of(address, f"GET /api/v1{path}") == 404, path
