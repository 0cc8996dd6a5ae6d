"""Who is let in: one place before all routes, which asks for the role that `rules` name, and refuses all else."""

import logging
from typing import Final

from starlette.requests import HTTPConnection, cookie_parser
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from daemon.access.access import Caller
from daemon.api.problems import HTTP_PROBLEMS, kind_of, respond
from daemon.api.rules import Rule, Rules
from daemon.api.witness import Witness, path_sent
from daemon.errors import AccessError, KeyRequiredError, RoleRequiredError
from daemon.service import Service

logger = logging.getLogger(__name__)

LAST_MESSAGE: Final[dict[str, Message]] = {
    "http": {"type": "http.response.body", "body": b"", "more_body": False},
    "websocket": {"type": "websocket.close", "code": 1008, "reason": "the key is not good any more"},
}
"""What ends a stream whose key is not good any more."""


class Gate:
    """ASGI middleware: routes find who asks in `scope["caller"]`, None where it is not known and need not be."""

    def __init__(self, app: ASGIApp, service: Service, rules: Rules) -> None:
        self._app = app
        self._access = service.access
        self._rules = rules

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let in who may come in."""
        rule = self._rules.find("WS" if scope["type"] == "websocket" else scope["method"], scope["path"])
        try:
            caller = scope["caller"] = self._identify(scope, rule)
        except AccessError as error:
            await _refused(scope, error)(scope, receive, send)
            return
        if rule is None:
            await self._unknown(scope)(scope, receive, send)
            return
        if caller is not None and caller.key is not None:
            send = self._while_known(caller, scope, send)
        try:
            if rule.written and caller is not None:
                await Witness(self._access.book, caller, scope).follow(self._app, receive, send)
            else:
                await self._app(scope, receive, send)
        except _NoLongerKnownError:
            pass  # its last message has been sent

    def _identify(self, scope: Scope, rule: Rule | None) -> Caller | None:
        """Return who asks; raises AccessError unless that may do what `rule` is of."""
        authorization = cookie = None
        if self._access.keys_asked:
            for name, value in scope["headers"]:
                if name == b"authorization":
                    authorization = value
                elif name == b"cookie":
                    cookie = cookie_parser(value.decode("latin-1")).get(cookie_name(scope))
        try:
            caller = self._access.identify(authorization, cookie)
        except AccessError:
            if rule is not None and rule.role is None:
                return None
            raise
        if rule is not None and rule.role is not None and not caller.role.includes(rule.role):
            raise RoleRequiredError(
                f"a key of role '{rule.role}' is needed for this, and this one is of role '{caller.role}'"
            )
        return caller

    def _unknown(self, scope: Scope) -> Response:
        methods = self._rules.methods(scope["path"]) if scope["type"] == "http" else []
        kind = HTTP_PROBLEMS[405 if methods else 404]
        headers = {"Allow": ", ".join(methods)} if methods else None
        method = scope.get("method", "WebSocket")
        return respond(HTTPConnection(scope), kind, f"{kind.title}: {method} {scope['path']}", headers)

    def _while_known(self, caller: Caller, scope: Scope, send: Send) -> Send:
        """Return `send` that ends a stream once the key, or the session, of `caller` is not good any more."""

        async def send_if_known(message: Message) -> None:
            goes_on = message["type"] == "websocket.send" or message.get("more_body", False)
            if goes_on and not self._access.still_knows(caller):
                await send(LAST_MESSAGE[scope["type"]])
                raise _NoLongerKnownError
            await send(message)

        return send_if_known


class _NoLongerKnownError(Exception):
    """The key of a stream was removed while it went on."""


def cookie_name(scope: Scope) -> str:
    """Return the name of a session's cookie: browsers send a cookie to all ports of a machine."""
    server = scope.get("server")
    return "activecam" if server is None else f"activecam_{server[1]}"


def _refused(scope: Scope, error: AccessError) -> Response:
    kind = kind_of(error)
    if not isinstance(error, KeyRequiredError):
        address = (scope.get("client") or ("somewhere",))[0]
        logger.warning("%s was refused to %s: %s", path_sent(scope), address, error)
    headers = {"WWW-Authenticate": "Bearer"} if kind.status == 401 else None
    return respond(HTTPConnection(scope), kind, str(error), headers)
