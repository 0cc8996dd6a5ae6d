"""A request on its way to a route and its answer on the way back, as the audit log tells of them."""

import asyncio
import json
from datetime import UTC, datetime
from typing import Final

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from daemon.access.access import Caller
from daemon.access.book import AuditBook
from daemon.access.entries import AuditEntry
from daemon.api.problems import MEDIA_TYPE
from daemon.operation.log_fields import log_fields

KEPT: Final = 1000
"""Bytes of a request's body that are written down; what moves an axis is less."""
LONG: Final = 0.2
"""Seconds after which a request that goes on, as a motion that is waited for, is written before it ends."""


class Witness:
    """Sees one request. Nobody waits for what is written of it."""

    def __init__(self, book: AuditBook, caller: Caller, scope: Scope) -> None:
        self._book = book
        self._scope = scope
        self._asked = bytearray()
        self._answered = bytearray()
        self._is_problem = False
        self._noted = False
        self.entry = AuditEntry(
            time=datetime.now(UTC),
            who=None if caller.key is None else caller.key.name,
            role=caller.role,
            address=(scope.get("client") or ("",))[0],
            method=scope["method"],
            path=path_sent(scope),
        )

    async def follow(self, app: ASGIApp, receive: Receive, send: Send) -> None:
        """Pass the request on to `app`; a route may take it out of the log by `leave_unwritten`."""

        async def take() -> Message:
            message = await receive()
            if message["type"] == "http.request":
                self._take(message)
            return message

        async def answer(message: Message) -> None:
            self._answer(message)
            await send(message)

        beginning = asyncio.get_running_loop().call_later(LONG, self._note)
        who = {} if self.entry.who is None else {"who": self.entry.who}
        try:
            with log_fields(**who):
                await app(self._scope, take, answer)
        except Exception:
            self.entry.status = 500
            raise
        finally:
            beginning.cancel()
            if self._noted or not self._scope.get(_UNWRITTEN):
                self._note()

    def _note(self) -> None:
        self._noted = True
        self._book.note(self.entry)

    def _take(self, message: Message) -> None:
        self._asked += message.get("body", b"")[: KEPT - len(self._asked)]
        self.entry.asked = self._asked.decode(errors="replace")

    def _answer(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.entry.status = message["status"]
            self._is_problem = (b"content-type", MEDIA_TYPE.encode()) in message["headers"]
        elif self._is_problem:
            self._answered += message.get("body", b"")
            if not message.get("more_body", False):
                self.entry.code = json.loads(self._answered)["code"]


def path_sent(scope: Scope) -> str:
    """Return the path as it was sent, in which nothing passes for the end of a line."""
    raw: bytes = scope["raw_path"]
    return raw.decode("ascii", "backslashreplace")


_UNWRITTEN: Final = "activecam.unwritten"


def leave_unwritten(scope: Scope) -> None:
    """Keep a request out of the audit log: it does nothing that is not in there already."""
    scope[_UNWRITTEN] = True
