"""Requests that come over a WebSocket, answered by the app as if they had come over HTTP.

So there is one place for each rule: the gate asks for the role, the witness writes the audit log, routes check leases
and limits, and errors are problem documents.
"""

from typing import Any, Final
from urllib.parse import quote

from fastapi import WebSocket
from pydantic_core import from_json
from starlette.types import Message

from daemon.api.rules import PREFIX

KEPT: Final = frozenset({b"host", b"origin", b"authorization", b"cookie"})
"""Headers of the request that opened the socket which say who asks, and from where."""
SCHEMES: Final = {"ws": "http", "wss": "https"}


class Relay:
    """Asks the app on behalf of one socket's client."""

    def __init__(self, socket: WebSocket) -> None:
        opened = socket.scope
        self._app = opened["app"]
        self._headers = [(name, value) for name, value in opened["headers"] if name in KEPT]
        self._scope = {name: opened.get(name) for name in ("asgi", "client", "server")} | {
            "type": "http",
            "http_version": "1.1",
            "scheme": SCHEMES[opened["scheme"]],
            "root_path": opened.get("root_path", ""),
            "query_string": b"",
        }

    async def ask(self, method: str, route: str, body: bytes, lease: str | None) -> tuple[int, Any]:
        """Return the status and the document that `route` answers; `lease` is the token to show."""
        path = PREFIX + route
        headers = [*self._headers, (b"content-type", b"application/json")]
        if lease is not None:
            headers.append((b"x-lease", lease.encode()))
        scope = self._scope | {
            "method": method,
            "path": path,
            "raw_path": quote(path).encode(),
            "headers": headers,
        }
        asked: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]
        status, answered = 0, bytearray()

        async def receive() -> Message:
            return asked.pop() if asked else {"type": "http.disconnect"}

        async def send(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            else:
                answered.extend(message.get("body", b""))

        await self._app(scope, receive, send)
        return status, from_json(bytes(answered)) if answered else None
