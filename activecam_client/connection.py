"""Requests to a daemon, and its pose stream; what goes wrong is raised as this package's errors."""

import json
import ssl
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final
from urllib.parse import urlencode

import httpx
from websockets.exceptions import ConnectionClosed, ConnectionClosedOK, WebSocketException
from websockets.sync.client import connect

from activecam_client.errors import ProblemError, UnreachableError

PREFIX: Final = "/api/v1"
PATIENCE: Final = 10.0
"""Seconds within which the daemon has to answer what it answers at once."""


class Connection:
    """The way to one daemon. Threads may share it."""

    def __init__(self, address: str, key: str | None, tls: ssl.SSLContext | None) -> None:
        self._address = address.rstrip("/") + PREFIX
        self._headers = {} if key is None else {"Authorization": f"Bearer {key}"}
        self._tls = tls
        self._http = httpx.Client(
            headers=self._headers, timeout=PATIENCE, verify=True if tls is None else tls
        )

    def close(self) -> None:
        """Hang up."""
        self._http.close()

    def ask(
        self,
        method: str,
        path: str,
        body: Mapping[str, Any] | None = None,
        *,
        query: Mapping[str, str | list[str]] | None = None,
        headers: Mapping[str, str] | None = None,
        patience: float | None = PATIENCE,
    ) -> Any:
        """Return the answer to a request; `patience` (s) is None for what takes as long as a motion."""
        with self._reached():
            answer = self._http.request(
                method,
                self._address + path,
                json=body,
                params=query,
                headers=headers,
                timeout=httpx.Timeout(PATIENCE, read=patience),
            )
        _require_good(answer)
        return answer.json() if answer.content else None

    def events(self, path: str, after: int) -> Iterator[Any]:
        """Yield the server-sent events after the one numbered `after`, until the daemon ends the stream."""
        with (
            self._reached(),
            self._http.stream(
                "GET", self._address + path, params={"after": after}, timeout=httpx.Timeout(PATIENCE, read=60)
            ) as answer,
        ):
            if answer.is_error:
                answer.read()
            _require_good(answer)
            for line in answer.iter_lines():
                if line.startswith("data: "):
                    yield json.loads(line.removeprefix("data: "))

    def messages(self, path: str, query: Mapping[str, str]) -> Iterator[Any]:
        """Yield the messages of a WebSocket, each when it is asked for, until the daemon ends it."""
        address = self._address.replace("http", "ws", 1) + path + ("?" + urlencode(query) if query else "")
        try:
            with connect(
                address, additional_headers=self._headers, ssl=self._tls, open_timeout=PATIENCE
            ) as socket:
                try:
                    while True:
                        socket.send("next")
                        yield json.loads(socket.recv())
                except ConnectionClosedOK:
                    return
                except ConnectionClosed as error:
                    raise UnreachableError(f"{self._address} has hung up: {error}") from error
        except (OSError, WebSocketException) as error:
            raise UnreachableError(f"{address} cannot be followed: {error}") from error

    @contextmanager
    def _reached(self) -> Iterator[None]:
        try:
            yield
        except httpx.HTTPError as error:
            raise UnreachableError(f"{self._address} does not answer: {error}") from error


def _require_good(answer: httpx.Response) -> None:
    if answer.is_success:
        return
    try:
        problem = ProblemError(answer.json())
    except (ValueError, KeyError, TypeError):
        raise UnreachableError(
            f"what answers at {answer.url} with {answer.status_code} is no activecam daemon"
        ) from None
    raise problem
