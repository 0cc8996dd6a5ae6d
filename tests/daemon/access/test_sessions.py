"""A browser shows a key once, and is known by a cookie from then on."""

from http.cookies import SimpleCookie

import httpx
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from daemon.access.keys import digest_of, make_key
from daemon.access.roles import Role
from daemon.access.sessions import LIFE, MOST, Sessions
from daemon.service import Service
from tests.daemon.access.keys import bearer, close_code


async def test_a_session_may_what_its_key_may(
    flowing: str, http: httpx.AsyncClient, secrets: dict[Role, str]
) -> None:
    begun = await http.post("/session", headers=bearer(secrets[Role.OPERATOR]))
    assert begun.json() == {"key": "operator", "role": "operator", "may": ["read", "move"]}
    [(name, cookie)] = SimpleCookie(begun.headers["set-cookie"]).items()
    assert name == f"activecam_{flowing.rpartition(':')[2]}"  # another daemon's on this machine is left alone
    assert cookie.value != secrets[Role.OPERATOR]
    assert (cookie["httponly"], cookie["samesite"], cookie["path"], cookie["secure"]) == (
        True,
        "strict",
        "/",
        "",
    )
    assert int(cookie["max-age"]) == LIFE

    assert (await http.get("/session")).json() == begun.json()
    assert (await http.post("/lease", json={"owner": "anna"})).status_code == 200
    assert (await http.get("/audit")).json()["code"] == "role_required"
    again = await http.post("/session")
    assert (again.status_code, "set-cookie" in again.headers) == (200, False)
    shown = {"Cookie": f"other=1; {name}={cookie.value}"}
    async with connect(
        f"{flowing.replace('http', 'ws')}/api/v1/pose/stream", additional_headers=shown
    ) as stream:
        await stream.recv()
        ended = await http.delete("/session")
        assert ended.status_code == 204
        assert "Max-Age=0" in ended.headers["set-cookie"]
        assert await close_code(stream) == 1008
    answer = await http.get("/rig", headers=shown)
    assert (answer.status_code, answer.json()["code"]) == (401, "key_unknown")


async def test_a_page_from_elsewhere_does_nothing_with_it(
    guarded: Service, address: str, http: httpx.AsyncClient, secrets: dict[Role, str]
) -> None:
    await http.post("/session", headers=bearer(secrets[Role.OPERATOR]))
    foreign = {"Origin": "http://elsewhere.example"}
    for method, path in (("POST", "/lease"), ("POST", "/session"), ("DELETE", "/session"), ("POST", "/runs")):
        answer = await http.request(method, path, headers=foreign)
        assert (answer.status_code, answer.json()["code"]) == (403, "foreign_page")
    cookies = {"Cookie": "; ".join(f"{name}={value}" for name, value in http.cookies.items())}
    with pytest.raises(InvalidStatus):
        await connect(
            f"{address.replace('http', 'ws')}/api/v1/pose/stream", additional_headers=cookies | foreign
        )
    assert (await http.get("/session")).status_code == 200


async def test_a_wrong_key_begins_none(http: httpx.AsyncClient) -> None:
    answer = await http.post("/session", headers=bearer("guess"))
    assert (answer.status_code, answer.json()["code"]) == (401, "key_unknown")
    assert "set-cookie" not in answer.headers


def test_a_session_ends_with_its_time_or_when_its_key_has_too_many() -> None:
    now = 0.0
    sessions = Sessions(lambda: now)
    _, mine = make_key("mine", Role.VIEWER)
    _, other = make_key("other", Role.VIEWER)

    def good(secret: str) -> bool:
        return sessions.find(digest_of(secret.encode())) is not None

    kept = sessions.begin(other)
    first = sessions.begin(mine)
    latest = [sessions.begin(mine) for _ in range(MOST)]
    assert not good(first)
    assert all(map(good, [kept, *latest]))
    now = LIFE
    assert not any(map(good, [kept, *latest]))
    assert good(sessions.begin(mine))
