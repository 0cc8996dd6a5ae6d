"""The page's WebSocket: what the rig does, and commands to it, which wait for nothing and for nobody."""

import asyncio
import contextlib
from collections.abc import AsyncGenerator, AsyncIterator
from typing import Any, Final, Literal

from fastapi import APIRouter, WebSocket, WebSocketDisconnect, status
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import to_json

from daemon.api import problems
from daemon.api.live_state import PERIOD, LiveState
from daemon.api.relay import Relay
from daemon.api.session import SessionDocument
from daemon.api.sockets import first_of, send
from daemon.errors import LeaseEndedError, LeaseHeldError
from daemon.procedure import RunEvent
from daemon.service import Service

router = APIRouter(tags=["rig"])

ROUTES: Final = {
    "stop": ("POST", "/stop"),
    "acknowledge": ("POST", "/stop/acknowledge"),
    "lease": ("POST", "/lease"),
    "release": ("DELETE", "/lease"),
    "home": ("POST", "/axes/{axis}/home"),
    "jog": ("POST", "/axes/{axis}/jog"),
    "move": ("POST", "/axes/move"),
    "stop_axis": ("POST", "/axes/{axis}/stop"),
}
"""Which request each command stands for. What a command has beside its own keys is the request's body."""

STOPS: Final = frozenset({"stop", "stop_axis"})
MOST_COMMANDS: Final = 64
"""Commands of a client that may wait for their answers. Beyond them none but STOPS is carried out."""
MOST_ANSWERS: Final = 1024
"""Answers, refusals among them, that a client may leave waiting before it is let go, and what it moves is stopped."""


class Command(BaseModel):
    """What a client wants; `id` comes back with the answer."""

    model_config = ConfigDict(extra="allow", strict=True)

    id: int | str
    do: Literal["stop", "acknowledge", "lease", "release", "home", "jog", "move", "stop_axis"]
    axis: str = ""


@router.websocket("/live")
async def follow_live(socket: WebSocket) -> None:
    """Tell the state whenever it changes, and events of runs; carry out commands, each as soon as it comes.

    A lease that was taken over this socket ends with it, and so do the motions under it. Who sends and sends and
    takes no answers is let go.
    """
    service: Service = socket.app.state.service
    states: LiveState = socket.app.state.live_state
    await socket.accept()
    client = Client(socket, service)
    try:
        await first_of(
            send(socket, service.streams.follow(client.states(states))),
            send(socket, _events(service)),
            send(socket, client.answers()),
            client.obey(),
        )
    finally:
        await client.leave()
    if client.floods:
        with contextlib.suppress(WebSocketDisconnect):
            await socket.close(status.WS_1008_POLICY_VIOLATION, "too many commands wait for their answers")


class Client:
    """Who has a socket open: the lease that was taken over it, and the commands under way."""

    def __init__(self, socket: WebSocket, service: Service) -> None:
        self._socket = socket
        self._leases = service.leases
        self._relay = Relay(socket)
        self._who = SessionDocument.of(socket.scope["caller"]).model_dump()
        self._token: str | None = None
        self._commands: set[asyncio.Task[None]] = set()
        self._answered: asyncio.Queue[str] = asyncio.Queue()
        self._waiting = 0  # commands whose answers are not sent yet

    @property
    def floods(self) -> bool:
        """Whether more answers wait than a client can want."""
        return self._waiting > MOST_ANSWERS

    async def states(self, states: LiveState) -> AsyncIterator[str]:
        """Yield each state with who this client is, and whether it holds the lease."""
        async for state in states.follow():
            current = self._leases.current
            holds = current is not None and current.token == self._token
            yield f'{state[:-1]},"you":{to_json(self._who | {"holds_lease": holds}).decode()}}}'

    async def answers(self) -> AsyncGenerator[str]:
        """Yield what each command has come to, in the order in which they do."""
        while True:
            yield await self._answered.get()
            self._waiting -= 1

    async def obey(self) -> None:
        """Begin each command as it comes, whatever the ones before it do, until the client has gone, or floods."""
        while not self.floods and (message := await self._socket.receive())["type"] != "websocket.disconnect":
            self._waiting += 1
            text = message.get("text") or message.get("bytes") or b""
            task = asyncio.create_task(self._carry_out(text, stops_only=self._waiting > MOST_COMMANDS))
            self._commands.add(task)
            task.add_done_callback(self._commands.discard)

    async def leave(self) -> None:
        """Give the lease back; also one that was asked for when the client went."""
        self._release()
        await asyncio.gather(*self._commands, return_exceptions=True)
        self._release()

    async def _carry_out(self, text: str | bytes, *, stops_only: bool) -> None:
        answer = await self._answer(text, stops_only)
        self._answered.put_nowait(to_json({"type": "answer"} | answer).decode())

    async def _answer(self, text: str | bytes, stops_only: bool) -> dict[str, Any]:
        address = self._socket.url.path
        try:
            command = Command.model_validate_json(text)
        except ValidationError as error:
            problem = problems.invalid(error.errors(), address)
            return {"id": None, "status": problem["status"], "problem": problem}
        if stops_only and command.do not in STOPS:
            detail = (
                f"{MOST_COMMANDS} commands wait for their answers: wait, only stops are carried out meanwhile"
            )
            problem = problems.document(problems.TOO_MANY_COMMANDS, detail, address)
            return {"id": command.id, "status": problem["status"], "problem": problem}
        method, route = ROUTES[command.do]
        body = to_json(command.model_extra)
        code, document = await self._relay.ask(method, route.format(axis=command.axis), body, self._token)
        if code >= 400:
            return {"id": command.id, "status": code, "problem": document}
        if command.do == "lease":
            self._token = document["token"]
        return {"id": command.id, "status": code, "body": document}

    def _release(self) -> None:
        if self._token is not None:
            with contextlib.suppress(LeaseEndedError, LeaseHeldError):
                self._leases.release(self._token)


async def _events(service: Service) -> AsyncGenerator[str]:
    """Yield the events of the latest run, and of each one after it, from its first."""
    followed, told = None, dict[str, int]()
    while True:
        run = service.runs.latest
        if run is None or run is followed:
            await asyncio.sleep(PERIOD)
            continue
        followed, run_id = run, run.record.id
        async for event in run.log.follow(told.get(run_id, 0)):
            told[run_id] = event.sequence
            yield _written(event)


def _written(event: RunEvent) -> str:
    return f'{{"type":"event","event":{event.model_dump_json()}}}'
