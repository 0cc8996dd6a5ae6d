"""What is refused before any route sees it: foreign pages, foreign names, and bodies that no route could want."""

import ipaddress
from collections.abc import Collection
from functools import lru_cache
from typing import Final
from urllib.parse import urlsplit

from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from daemon.api.problems import BODY_TOO_LARGE, FOREIGN_PAGE, HOST_UNKNOWN, Kind, respond

LARGEST_BODY: Final = 8 * 1024 * 1024
"""Bytes; ten thousand vectors of readings are less. Parsing more would hold up everybody else, and a stop."""
HARMLESS: Final = frozenset({"GET", "HEAD", "OPTIONS"})


class Guard:
    """ASGI middleware around the whole app, which answers to addresses, to `localhost` and to `host_names`.

    A page of an attacker's that gives its own name the daemon's address (DNS rebinding) asks under that name;
    a name that is an address cannot be given to another.
    """

    def __init__(self, app: ASGIApp, host_names: Collection[str] = ()) -> None:
        self._app = app
        self._names = frozenset(name.lower() for name in host_names)
        self._answers_to = lru_cache(256)(self._is_own)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what may pass."""
        if refusal := self._refusal(scope):
            await respond(HTTPConnection(scope), *refusal)(scope, receive, send)
            return
        if scope["type"] == "http" and scope["method"] not in HARMLESS:
            receive = _limited(receive)
        await self._app(scope, receive, send)

    def _refusal(self, scope: Scope) -> tuple[Kind, str] | None:
        if scope["type"] == "http" and scope["method"] == "POST" and scope["path"].endswith("/stop"):
            return None  # whoever asks for a stop gets it
        host = origin = None
        for name, value in scope["headers"]:
            if name == b"host":
                host = value
            elif name == b"origin":
                origin = value
        if host is None or not self._answers_to(host):
            name = "" if host is None else _name_of(host)
            return HOST_UNKNOWN, (
                f"this daemon is not known as '{name}': ask by its address, or serve with --host-name {name or 'NAME'}"
            )
        if origin is None or origin.lower().partition(b"://")[2] == host.lower():
            return None
        if scope["type"] == "http" and scope["method"] in HARMLESS:
            return None  # the page that asked may not read the answer, for want of CORS
        page = origin.decode("latin-1")
        return FOREIGN_PAGE, f"a page of {page} may do nothing here: use this daemon's own address"

    def _is_own(self, host: bytes) -> bool:
        name = _name_of(host)
        if name in self._names or name == "localhost" or name.endswith(".localhost"):
            return True
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True


def _name_of(host: bytes) -> str:
    """Return the name, or the address, of a header Host, without its port; empty where it is neither."""
    try:
        return urlsplit(f"//{host.decode('latin-1')}").hostname or ""
    except ValueError:
        return ""


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
