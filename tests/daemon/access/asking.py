"""Routes asked as anybody could ask them, who has nothing of the daemon's.

`python -m tests.daemon.access.asking ADDRESS KEY ROUTE...` asks each, with the key and without one, and prints what was
answered.
"""

import asyncio
import json
import sys
from typing import Any

import httpx
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from tests.daemon.access.keys import bearer

BODIES: dict[str, dict[str, Any]] = {
    "POST /api/v1/lease": {"owner": "eve"},
    "POST /api/v1/axes/move": {"targets": {"pan": 1.0}},
    "POST /api/v1/axes/{name}/move": {"target": 1.0},
    "POST /api/v1/axes/{name}/jog": {"distance": 1.0},
    "POST /api/v1/pose": {"readings": [[1.0, 2.0]]},
    "POST /api/v1/project": {"points": [[0.0, 0.0, 0.0]]},
    "POST /api/v1/rays": {"pixels": [[0.0, 0.0]]},
}


async def outcome(http: httpx.AsyncClient, route: str, headers: dict[str, str]) -> tuple[int, str | None]:
    """Ask, and return the status and the problem's code, if there is one."""
    method, path = route.split()
    path = path.replace("{name}", "pan").replace("{run_id}", "none").replace("{calibration_id}", "none")
    path = path.replace("{file}", "page.css")
    url = http.base_url.join(path)
    if method == "WS":
        try:
            async with connect(str(url.copy_with(scheme="ws")), additional_headers=headers) as stream:
                await stream.send("next")  # which pictures are sent for
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


async def status_of(address: str, asked: str, headers: dict[str, str] | None = None) -> int:
    """Send a method and an address as they stand here, of which clients would make something else."""
    host, _, port = address.removeprefix("http://").partition(":")
    sent = {"Host": host, "Connection": "close", "Content-Length": "0"} | (headers or {})
    reader, writer = await asyncio.open_connection(host, int(port))
    head = "".join(f"{name}: {value}\r\n" for name, value in sent.items())
    writer.write(f"{asked} HTTP/1.1\r\n{head}\r\n".encode())
    status = (await reader.read()).split(b" ")[1]
    writer.close()
    await writer.wait_closed()
    return int(status)


async def main(address: str, key: str, *routes: str) -> None:
    async with httpx.AsyncClient(base_url=address, timeout=30) as http:
        answers = [
            {route: await outcome(http, route, headers) for route in routes} for headers in (bearer(key), {})
        ]
    sys.stdout.write(json.dumps(answers))


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))
