"""Every request from outside: its id, its record in the log, and how long it took."""

import logging
import re
import secrets
import time
from typing import Final

from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from daemon.api import problems
from daemon.operation.log_fields import log_fields
from daemon.service import Service

logger = logging.getLogger(__name__)

REQUEST_ID: Final = b"x-request-id"
_FIT: Final = re.compile(rb"[\w.:-]{1,64}", re.ASCII)
READING: Final = frozenset({"GET", "HEAD", "OPTIONS"})
METHODS: Final = READING | {"POST", "PUT", "PATCH", "DELETE"}


class Observed:
    """ASGI middleware around all others.

    A request's id is the client's own, from the header X-Request-ID, or a new one; it is in the answer's header and in
    each record that is logged meanwhile, also of the motions and the run that the request begins.
    """

    def __init__(self, app: ASGIApp, prefix: str) -> None:
        self._app = app
        self._prefix = prefix

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, and note what became of it."""
        request_id = _id_of(scope)
        with log_fields(request=request_id.decode()):
            if scope["type"] == "http":
                await self._answer(scope, receive, send, request_id)
            else:
                await self._app(scope, receive, send)

    async def _answer(self, scope: Scope, receive: Receive, send: Send, request_id: bytes) -> None:
        began, took, status = time.perf_counter(), 0.0, 0

        async def send_on(message: Message) -> None:
            nonlocal took, status
            if message["type"] == "http.response.start":
                took, status = time.perf_counter() - began, message["status"]
                message["headers"] = [*message["headers"], (REQUEST_ID, request_id)]
            await send(message)

        try:
            await self._app(scope, receive, send_on)
        except Exception as error:
            if status:
                raise
            # Answered here, where the request's id is known.
            await (await problems.answer(Request(scope), error))(scope, receive, send_on)
        finally:
            if status:
                self._note(scope, status, took)

    def _note(self, scope: Scope, status: int, took: float) -> None:
        method = scope["method"] if scope["method"] in METHODS else "other"
        service: Service = scope["app"].state.service
        service.figures.answered(method, self._route(scope), status, took)
        level = logging.DEBUG if method in READING and status < 500 else logging.INFO
        if logger.isEnabledFor(level):
            # The path as it was sent, and no query: what a client writes there is its own business.
            path = scope.get("raw_path", b"").decode("ascii", "replace")
            extra = {"status": status, "duration_ms": round(1e3 * took, 3)}
            logger.log(level, "%s %s: %d", method, path, status, extra=extra)

    def _route(self, scope: Scope) -> str:
        """Return the template of the address, so that there are no more of them than routes."""
        path: str = getattr(scope.get("route"), "path", "none")
        return path.removeprefix(self._prefix)


def _id_of(scope: Scope) -> bytes:
    for name, value in scope["headers"]:
        if name == REQUEST_ID and _FIT.fullmatch(value):
            given: bytes = value
            return given
    return secrets.token_hex(8).encode()
