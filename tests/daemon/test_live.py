"""The page's socket: what the rig does, as it does it, and commands that are requests like any other."""

import asyncio
import contextlib
import json
from collections.abc import AsyncGenerator
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from daemon.api import live_state
from daemon.api.live import MOST_ANSWERS, MOST_COMMANDS, Client
from daemon.api.live_state import LiveState
from daemon.client_motion import ClientMotions
from daemon.service import Service


@pytest.fixture
def live(address: str) -> str:
    """The socket's address."""
    return f"{address.replace('http', 'ws')}/api/v1/live"


async def message(socket: ClientConnection, kind: str) -> dict[str, Any]:
    """Return the next message of a kind."""
    while True:
        found: dict[str, Any] = json.loads(await socket.recv())
        if found["type"] == kind:
            return found


async def state(socket: ClientConnection, fits: Any) -> dict[str, Any]:
    """Return the next state that fits."""
    while not fits(found := await message(socket, "state")):
        pass
    return found


async def ask(socket: ClientConnection, **command: Any) -> dict[str, Any]:
    await socket.send(json.dumps({"id": 1} | command))
    return await message(socket, "answer")


async def test_the_state_is_told_at_once_and_whenever_it_changes(service: Service, live: str) -> None:
    async with connect(live) as socket:
        first = await message(socket, "state")
        assert (first["rig"]["name"], first["run"], first["problems"]) == ("small-rig", None, [])
        assert first["you"] == {
            "key": None,
            "role": "admin",
            "may": ["read", "move", "audit"],
            "holds_lease": False,
        }
        service.leases.acquire("anna", "", 30)
        held = await state(socket, lambda told: told["rig"]["lease"] is not None)
        assert (held["rig"]["lease"]["owner"], held["you"]["holds_lease"]) == ("anna", False)


async def test_a_state_is_made_once_for_all_who_follow(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_state, "PERIOD", 0.01)
    monkeypatch.setattr(live_state, "SILENCE", 10**9)  # nothing is told but what has changed
    states = LiveState(service)
    followers = [aiter(states.follow()) for _ in range(3)]
    for owner in ("anna", "ben", "chris"):
        service.leases.take_over(owner, "", 60)
        told = [await anext(follower) for follower in followers]
        assert told[0] is told[1] is told[2]
        assert owner in told[0]


async def test_silence_is_broken_before_anybody_takes_it_for_the_end(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_state, "PERIOD", 0.01)
    monkeypatch.setattr(LiveState, "_differs", lambda *_: False)
    states = aiter(LiveState(service).follow())
    first, second = json.loads(await anext(states)), json.loads(await anext(states))
    assert second["time"] > first["time"]


async def test_a_command_is_carried_out_under_the_lease_of_its_socket(service: Service, live: str) -> None:
    async with connect(live) as socket, connect(live) as other:
        refused = await ask(other, do="home", axis="pan")
        assert (refused["status"], refused["problem"]["code"]) == (401, "lease_required")
        lease = await ask(socket, do="lease", owner="anna", note="looking")
        assert (lease["status"], lease["body"]["owner"]) == (200, "anna")
        await state(socket, lambda told: told["you"]["holds_lease"])
        begun = await ask(socket, do="home", axis="pan")
        assert (begun["id"], begun["status"], begun["body"]["name"]) == (1, 202, "pan")
        await state(socket, lambda told: told["rig"]["axes"][1]["homed"])
        beyond = await ask(socket, do="move", targets={"pan": 99})
        assert (beyond["status"], beyond["problem"]["code"]) == (422, "limit_exceeded")
        held = await ask(other, do="lease", owner="ben")
        assert held["problem"]["code"] == "lease_held"
        assert (await ask(other, do="lease", owner="ben", take_over=True))["status"] == 200
        await state(socket, lambda told: not told["you"]["holds_lease"])
        assert (await ask(other, do="release"))["status"] == 204
        assert service.leases.current is None


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> asyncio.Event:
    """No motion begins until it is set."""
    begin, held = ClientMotions.begin, asyncio.Event()

    async def begin_late(*arguments: Any) -> Any:
        await held.wait()
        return await begin(*arguments)

    monkeypatch.setattr(ClientMotions, "begin", begin_late)
    return held


async def test_a_stop_waits_for_no_command_before_it(live: str, held: asyncio.Event) -> None:
    async with connect(live) as socket:
        await ask(socket, do="lease", owner="anna")
        await socket.send(json.dumps({"id": "late", "do": "jog", "axis": "slide", "distance": 50}))
        stopped = await ask(socket, do="stop")
        assert (stopped["id"], stopped["status"], stopped["body"]["latched"]) == (1, 200, True)
        held.set()
        late = await message(socket, "answer")
        assert (late["id"], late["problem"]["code"]) == ("late", "stop_latched")
        assert (await ask(socket, do="acknowledge"))["body"]["latched"] is False


async def test_a_client_whose_commands_pile_up_may_still_stop(
    service: Service, live: str, held: asyncio.Event
) -> None:
    jog = {"do": "jog", "axis": "slide", "distance": 5}
    async with connect(live) as socket:
        await ask(socket, do="lease", owner="anna")
        for number in range(MOST_COMMANDS):
            await socket.send(json.dumps({"id": number} | jog))
        refused = await ask(socket, id="one more", **jog)
        assert (refused["id"], refused["status"]) == ("one more", 429)
        assert refused["problem"]["code"] == "too_many_commands"
        assert (await ask(socket, do="stop_axis", axis="slide"))["status"] == 200
        assert (await ask(socket, do="stop"))["body"]["latched"] is True
        held.set()
        late = [await message(socket, "answer") for _ in range(MOST_COMMANDS)]
        assert {each["id"] for each in late} == set(range(MOST_COMMANDS))
        assert (await ask(socket, do="acknowledge"))["body"]["latched"] is False


async def test_who_takes_no_answers_is_let_go_and_moves_nothing_any_more(
    service: Service, live: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Client, "answers", _untaken)
    async with connect(live) as socket:
        await socket.send(json.dumps({"id": 0, "do": "lease", "owner": "anna"}))
        await state(socket, lambda told: told["you"]["holds_lease"])
        with contextlib.suppress(ConnectionClosed):
            for number in range(2 * MOST_ANSWERS):
                await socket.send(json.dumps({"id": number, "do": "acknowledge"}))
        await socket.wait_closed()
    assert socket.close_code == 1008
    assert service.leases.current is None


async def _untaken(client: Client) -> AsyncGenerator[str]:
    """Yield nothing: a client that reads nothing, before whose network is full."""
    await asyncio.Event().wait()
    yield ""


async def test_what_is_no_command_is_refused_in_words(live: str) -> None:
    async with connect(live) as socket:
        for text, said in (
            ("no JSON", "message: Invalid JSON"),
            (b"\xff", "Invalid JSON"),
            ("[]", "message: Input should be an object"),
            ('{"id": 1, "do": "dance"}', "'stop'"),
            ('{"do": "stop"}', "id"),
        ):
            await socket.send(text)
            refused = await message(socket, "answer")
            assert (refused["id"], refused["status"], refused["problem"]["code"]) == (
                None,
                422,
                "invalid_request",
            )
            assert said in refused["problem"]["detail"]
        for axis in ("tilt", "../stop", "pan/../../stop"):
            refused = await ask(socket, do="stop_axis", axis=axis)
            assert refused["problem"]["code"] in {"unknown_axis", "not_found"}
        wrong = await ask(socket, do="jog", axis="pan", distance=1, speed=3)
        assert wrong["problem"]["code"] == "lease_required"  # before its body is looked at, as over HTTP


async def test_a_runs_events_come_from_its_first_to_its_last(service: Service, live: str) -> None:
    async with connect(live) as early:
        run = await service.runs.start("anna")
        events = [await message(early, "event")]
        while events[-1]["event"]["type"] != "finished":
            events.append(await message(early, "event"))
    assert [each["event"]["sequence"] for each in events] == list(range(1, len(events) + 1))
    assert {each["event"]["run_id"] for each in events} == {run.id}
    async with connect(live) as late:
        again = [await message(late, "event") for _ in events]
        over = await state(late, lambda told: told["run"]["state"] == "succeeded")
    assert again == events
    assert over["rig"]["run"] is None
