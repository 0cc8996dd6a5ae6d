"""Behind a proxy on the same machine, what it says of its clients is believed; said by anybody else it is not."""

import httpx
import pytest

from daemon.access.roles import Role
from daemon.server import LOCAL, Door, address_of, bind, serving
from daemon.service import Service
from tests.daemon.access.keys import bearer


@pytest.mark.parametrize(
    ("door", "address", "secure"),
    [(LOCAL, "127.0.0.1", False), (Door(["rig.lab"], keys=True, proxy=True), "192.0.2.7", True)],
    ids=["alone", "behind a proxy"],
)
async def test_who_asks_is_who_the_proxy_says(
    guarded: Service, secrets: dict[Role, str], door: Door, address: str, secure: bool
) -> None:
    passed_on = {"X-Forwarded-For": "192.0.2.7", "X-Forwarded-Proto": "https"}
    with bind("127.0.0.1", 0) as listening:
        async with (
            serving(guarded, listening, door),
            httpx.AsyncClient(base_url=f"{address_of(listening)}/api/v1", headers=passed_on) as http,
        ):
            begun = await http.post("/session", headers=bearer(secrets[Role.ADMIN]))
            assert ("secure" in begun.headers["set-cookie"].lower()) == secure
            await http.post("/stop/acknowledge", headers=bearer(secrets[Role.ADMIN]))
            [done] = await guarded.access.book.read()
    assert done.address == address
