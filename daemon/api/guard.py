"""What is refused before any route sees it: pages from elsewhere, and bodies that no route could want."""

from typing import Final
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from daemon.api.problems import BODY_TOO_LARGE, FOREIGN_PAGE, respond

LARGEST_BODY: Final = 8 * 1024 * 1024
"""Bytes; ten thousand vectors of readings are less. Parsing more would hold up everybody else, and a stop."""
HARMLESS: Final = frozenset({"GET", "HEAD", "OPTIONS"})


class Guard:
    """ASGI middleware around the whole app."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what may pass."""
        if scope["type"] == "websocket":
            if _from_elsewhere(Headers(scope=scope)):
                await WebSocketClose(1008, "this page comes from elsewhere")(scope, receive, send)
                return
        elif scope["type"] == "http" and scope["method"] not in HARMLESS:
            headers = Headers(scope=scope)
            # Whoever asks for a stop gets it.
            if _from_elsewhere(headers) and not scope["path"].endswith("/stop"):
                detail = f"a page of {headers['origin']} may not change anything here: use this daemon's own address"
                await respond(Request(scope), FOREIGN_PAGE, detail)(scope, receive, send)
                return
            receive = _limited(receive)
        await self._app(scope, receive, send)


def _from_elsewhere(headers: Headers) -> bool:
    """Whether a browser's page that was loaded from another address asks; browsers let it, unseen."""
    origin = headers.get("origin")
    return origin is not None and urlsplit(origin).netloc != headers.get("host")


def _limited(receive: Receive) -> Receive:
    """Return `receive` that raises as soon as the body is larger than any can be."""
    taken = 0

    async def take() -> Message:
        nonlocal taken
        message = await receive()
        taken += len(message.get("body", b""))
        if taken > LARGEST_BODY:
            raise HTTPException(BODY_TOO_LARGE.status)
        return message

    return take
