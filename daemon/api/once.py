"""Routes whose requests are carried out once where they have the header `Idempotency-Key`."""

import hashlib
import logging
import re
from collections.abc import Callable, Coroutine
from typing import Annotated, Any, Final

from fastapi import Depends, Header, Request, Response
from fastapi.routing import APIRoute

from daemon.api import problems
from daemon.api.witness import leave_unwritten
from daemon.errors import (
    IdempotencyConflictError,
    IdempotencyInProgressError,
    IdempotencyUnknownError,
    StoreError,
)
from daemon.service import Service
from daemon.store.answers import KeptAnswer

logger = logging.getLogger(__name__)

# A string of RFC 8941 in its quotes, as the draft wants it, or without them, as many clients send it.
PATTERN: Final = r'^("[ !#-~]{1,200}"|[!#-~]{1,200})$'
TELLING: Final = ("X-Lease", "Authorization", "Cookie", "Content-Type")
"""Headers of which a request with another value is another request."""

KEYED: Final = (IdempotencyConflictError, IdempotencyInProgressError, IdempotencyUnknownError)
"""What such a route may raise, for its description."""

_Key = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        pattern=PATTERN,
        description="A name that the client gives to this request, and to no other: sent again within 24 h, "
        "the request is answered as it was the first time, and not carried out again.",
        examples=['"8e03978e-40d5-43dd-bc93-6894a57f9324"'],
    ),
]


async def _once(_: _Key = None) -> None:
    """Describe the header."""


async def _once_durably(_: _Key = None) -> None:
    """Describe the header."""


ONCE: Final = Depends(_once)
"""The dependency of routes whose answers are kept as long as the daemon runs."""
ONCE_DURABLY: Final = Depends(_once_durably)
"""The dependency of routes whose answers are kept on disk."""


class OnceRoute(APIRoute):
    """The class of routes some of which depend on ONCE or ONCE_DURABLY."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the route's own handler, or one that calls it once for each key."""
        handle = super().get_route_handler()
        if ONCE not in self.dependencies and ONCE_DURABLY not in self.dependencies:
            return handle
        durable = ONCE_DURABLY in self.dependencies

        async def handle_once(request: Request) -> Response:
            key = request.headers.get("Idempotency-Key")
            if key is None or not re.fullmatch(PATTERN, key):
                return await handle(request)  # which refuses what is no key
            return await _carried_out(request, key.strip('"'), handle, durable=durable)

        return handle_once


async def _carried_out(
    request: Request, key: str, handle: Callable[[Request], Coroutine[Any, Any, Response]], *, durable: bool
) -> Response:
    service: Service = request.app.state.service
    given = await service.answers.begin(key, await _fingerprint(request), durable=durable)
    if given is not None:
        leave_unwritten(request.scope)
        headers = {"Idempotency-Replayed": "true"} | ({"Location": given.location} if given.location else {})
        return Response(given.body, given.status, headers, given.media_type)
    try:
        try:
            response = await handle(request)
        except Exception as error:  # an answer as well, and the request may have been carried out in part
            response = await problems.answer(request, error)
    except BaseException:
        service.answers.lose(key)
        raise
    shown = response.headers
    answer = KeptAnswer(
        response.status_code,
        shown.get("Content-Type", ""),
        bytes(response.body),
        shown.get("Location"),
    )
    try:
        await service.answers.settle(key, answer, durable=durable)
    except StoreError as error:
        logger.warning("an answer could not be kept beyond the end of the daemon: %s", error)
    return response


async def _fingerprint(request: Request) -> str:
    """Return what tells one request from another. A hash: it is stored, and tokens are in it."""
    parts = [request.method, request.url.path, request.url.query]
    parts += [request.headers.get(name, "") for name in TELLING]
    hashed = hashlib.sha256()
    for part in (*(part.encode() for part in parts), await request.body()):
        hashed.update(b"%d:" % len(part) + part)
    return hashed.hexdigest()
