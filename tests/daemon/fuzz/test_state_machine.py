"""Clients and faults at random, in every order: nothing moves that may not, and nothing is lost or left hanging."""

import asyncio
import contextlib
import functools
import tempfile
from collections.abc import Awaitable, Coroutine
from contextvars import copy_context
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar
from unittest import mock
from uuid import uuid4

import httpx
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from calib import Calibration
from daemon.api import create_app
from daemon.errors import StoreError
from daemon.rig import make_devices
from daemon.service import Service, running_service
from tests.daemon.calibrations import calibration_of
from tests.daemon.fuzz.adversary import Adversary
from tests.daemon.fuzz.effort import effort
from tests.daemon.fuzz.requests import CLIENTS, Request, anything, keyed, motions, steering, ttls
from tests.daemon.fuzz.virtual_time import LoopClock, VirtualTimeLoop
from tests.daemon.fuzz.watch import SHOWN, Watch
from tests.daemon.motions import until
from tests.daemon.rigs import small_rig

Result = TypeVar("Result")

PATIENCE = 120.0
"""Seconds of the rig's time in which whatever was asked for is over."""
FAULTS = [
    *(f"{name} {fault}" for name in ("stage", "head") for fault in ("lost", "mute", "late", "alarm")),
    *(f"{name} {fault}" for name in ("slide", "pan") for fault in ("stalls", "hangs")),
    *(f"camera {fault}" for fault in ("lost", "frozen", "late", "repeats")),
    *(f"{what} full{how}" for what in ("disk", "database") for how in ("", " once")),
]
OF_POINTS = "of points"
"""The calibration that there is before any run has found one."""
EVENTS = ["homing", "joint", "moving", "view", "state", "solving", "solved", "finished"]


class Clients(RuleBasedStateMachine):
    """Clients of one daemon, on a rig with whose faults nobody reckons."""

    def __init__(self) -> None:
        super().__init__()
        self._folder = tempfile.TemporaryDirectory()
        self._tokens: dict[str, str] = {}
        self._waiting: set[asyncio.Task[None]] = set()
        self._stack = contextlib.ExitStack()
        self._runner = self._stack.enter_context(asyncio.Runner(loop_factory=VirtualTimeLoop))
        clock = LoopClock(self._runner.get_loop())
        self._stack.enter_context(mock.patch("daemon.rig.utc.datetime", clock.utc()))
        profile = small_rig(Path(self._folder.name), time_scale=1.0, positions=3)
        self._adversary = Adversary(profile, clock)
        self._stack.enter_context(self._adversary.disk())
        self._profile = profile
        self._run(self._begin())

    def _run(self, work: Coroutine[Any, Any, Result]) -> Result:
        return self._runner.run(work)

    async def _begin(self) -> None:
        self._open = contextlib.AsyncExitStack()
        data = Path(self._folder.name) / "data"
        self._service: Service = await self._open.enter_async_context(
            running_service(self._profile, data, self._adversary.devices)
        )
        self._watch = Watch(self._service, self._adversary, data / "sessions")
        world = self._service.rig.world
        assert world is not None
        if self._service.poses.calibration_id is None:
            self._service.poses.activate(self._service.poses.prepare(OF_POINTS, _calibration()))
        for name in self._service.rig.specs:
            self._watch.sees(name, world.shaft(name)[1])
        transport = httpx.ASGITransport(create_app(self._service))
        self._http = httpx.AsyncClient(transport=transport, base_url="http://localhost/api/v1")

    async def _end(self) -> None:
        await in_time(self._open.aclose(), "the end")
        if self._waiting:
            await in_time(asyncio.wait(self._waiting), "what waits for a motion")
        await self._watch.close()
        for task in self._waiting:
            task.result()
        assert not self._watch.at_rest()
        left = asyncio.all_tasks() - {asyncio.current_task()}
        assert not left
        self._look_at_disk()

    @rule(requests=st.lists(anything, min_size=1, max_size=3), turns=st.integers(0, 8))
    def ask(self, requests: list[Request], turns: int) -> None:
        """Ask for one thing, or for several with hardly anything between them."""
        self._run(self._ask(requests, turns))

    @rule(fault=st.sampled_from(FAULTS))
    def go_wrong(self, fault: str) -> None:
        self._adversary.faults[fault]()

    @rule()
    def repair(self) -> None:
        self._adversary.repair()

    @rule(seconds=st.sampled_from([0.001, 0.01, 0.03, 0.1, 0.5, 3.0]))
    def wait(self, seconds: float) -> None:
        self._run(asyncio.sleep(seconds))

    @rule(kind=st.sampled_from(EVENTS), count=st.integers(1, 3))
    def follow(self, kind: str, count: int) -> None:
        """Wait until the run, if there is one, has told something, or a few seconds."""
        self._run(self._follow(kind, count))

    @rule(
        resumed=st.booleans(),
        fault=st.sampled_from([None, None, *FAULTS]),
        seconds=st.sampled_from([0.0, 0.3, 1.0, 2.0, 4.0]),
        then=st.lists(steering, max_size=2),
    )
    def begin_a_run(self, resumed: bool, fault: str | None, seconds: float, then: list[Request]) -> None:
        """Bring about all that a run needs, which chance hardly does, let it go on for a while, and steer it."""
        self._run(self._begin_a_run(resumed, fault, seconds))
        for request in then:
            self._run(self._ask([request], 0))
            self.wait(0.5)

    @rule(
        who=st.sampled_from(CLIENTS),
        ttl=ttls,
        homed=st.booleans(),
        motion=motions,
        then=st.lists(anything, max_size=2),
        turns=st.integers(0, 8),
        seconds=st.sampled_from([0.0, 0.0, 0.05, 1.0]),
    )
    def set_in_motion(
        self,
        who: str,
        ttl: float,
        homed: bool,
        motion: Request,
        then: list[Request],
        turns: int,
        seconds: float,
    ) -> None:
        """Bring about all that a client's motion needs, ask for more while it begins, and let it go on for a while."""
        asked = [replace(motion, shows=who), *then]
        self._run(self._set_in_motion(who, ttl, homed, asked, turns))
        self.wait(seconds)

    @rule(request=keyed, at_once=st.booleans())
    def ask_again(self, request: Request, at_once: bool) -> None:
        """Ask for one thing twice, as a client does that has heard no answer."""
        self._run(self._ask_again(request, at_once))

    @rule()
    def restart(self) -> None:
        self._adversary.repair()  # it would say that it cannot use its database
        self._run(self._end())
        before = self._service.poses.calibration_id
        self._tokens.clear()
        self._waiting.clear()
        self._run(self._begin())
        if before != OF_POINTS:
            assert self._service.poses.calibration_id == before, "another calibration is active"
        self._watch.runs.found(self._run(self._http.get("/runs")).json())

    @invariant()
    def all_holds(self) -> None:
        self._run(self._look())
        assert not self._watch.broken, self._watch.broken

    def teardown(self) -> None:
        try:
            self._run(self._end())
            assert not self._watch.broken, self._watch.broken
        finally:
            self._stack.close()
            self._folder.cleanup()

    async def _ask(self, requests: list[Request], turns: int) -> None:
        tasks = []
        for request in requests:
            context = copy_context()
            task = asyncio.get_running_loop().create_task(self._answered(request), context=context)
            if request.waits:
                self._waiting.add(task)
            else:
                tasks.append(task)
            for _ in range(turns):
                await asyncio.sleep(0)
        if tasks:
            await in_time(asyncio.gather(*tasks), str(requests))

    async def _answered(self, request: Request) -> None:
        await self._send(request, await self._worded(request))

    async def _worded(self, request: Request) -> httpx.Request:
        """Return the request as it is sent now, with the token that its client has."""
        token = None if request.shows is None else self._tokens.get(request.shows)
        return self._http.build_request(
            request.method,
            await self._named(request),
            json=request.body,
            headers={} if token is None else {"X-Lease": token},
            params={"wait": "true"} if request.waits else {},
        )

    async def _send(self, request: Request, worded: httpx.Request) -> httpx.Response:
        SHOWN.set(worded.headers.get("X-Lease"))
        problems, stops = self._service.rig.snapshot.problems, self._watch.stops
        answer = await self._http.send(worded)
        assert answer.status_code < 500 or answer.status_code == 503, answer.text
        assert request.path != "/stop" or self._watch.stops > stops, "a stop did not latch"
        done = request.method, request.path, answer.status_code
        if done == ("POST", "/lease", 200):
            assert request.shows is not None
            self._tokens[request.shows] = answer.json()["token"]
        if done == ("POST", "/runs", 202) and not answer.headers.get("Idempotency-Replayed"):
            self._watch.runs.started(problems)
        return answer

    async def _ask_again(self, request: Request, at_once: bool) -> None:
        worded = await self._worded(request)
        worded.headers["Idempotency-Key"] = uuid4().hex
        first = asyncio.create_task(self._send(request, worded))
        if not at_once:
            await in_time(asyncio.wait([first]), str(request))
        again = asyncio.create_task(self._send(request, worded))
        await in_time(asyncio.wait([first, again]), str(request))
        answer, replayed = first.result(), again.result()
        if answer.status_code == 503:  # perhaps before the key was noted
            return
        if not replayed.headers.get("Idempotency-Replayed"):
            assert at_once, f"{request} was carried out again"
            assert replayed.json()["code"] == "idempotency_in_progress"
        else:
            assert (replayed.status_code, replayed.content) == (answer.status_code, answer.content)

    async def _named(self, request: Request) -> str:
        """Return the path with the ids of what there is, as far as the database tells."""
        service, which = self._service, request.which
        with contextlib.suppress(StoreError):
            if "{run}" in request.path:
                return request.path.replace(
                    "{run}", _of([run.id for run in await service.runs.list()], which)
                )
            if "{calibration}" in request.path:
                found = [calibration.id for calibration in await service.store.calibrations()]
                return request.path.replace("{calibration}", _of(found, which))
        return request.path

    async def _follow(self, kind: str, count: int) -> None:
        run = self._service.runs.active
        if run is None:
            return
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(5):
                async for event in run.log.follow():
                    count -= event.type == kind
                    if not count:
                        return

    async def _make_sound(self) -> None:
        """Undo all that keeps the rig from moving."""
        self._adversary.repair()
        for path in ("/stop", "/stop/acknowledge"):
            await self._ask([Request("POST", path)], 0)
        sound = until(self._service.rig, lambda snapshot: not snapshot.problems)
        await in_time(sound, "a device's coming back")

    async def _set_in_motion(
        self, who: str, ttl: float, homed: bool, requests: list[Request], turns: int
    ) -> None:
        await self._make_sound()
        lease = {"owner": who, "ttl_s": ttl, "take_over": True}
        if homed:
            await self._ask([Request("POST", "/lease", lease | {"ttl_s": 60.0}, who)], 0)
            homings = [Request("POST", f"/axes/{name}/home", None, who) for name in self._service.rig.specs]
            await self._ask(homings, 0)
            standing = until(self._service.rig, lambda snapshot: not snapshot.moving)
            await in_time(standing, "homing")
        await self._ask([Request("POST", "/lease", lease, who)], 0)
        await self._ask(requests, turns)

    async def _begin_a_run(self, resumed: bool, fault: str | None, seconds: float) -> None:
        await self._make_sound()
        if resumed:  # by a stop
            await self._ask([Request("POST", "/runs", shows="anna")], 0)
            await self._follow("view", 1)
            await self._make_sound()
        if fault is not None:
            self._adversary.faults[fault]()
            await asyncio.sleep(seconds)
        await self._ask([Request("POST", "/runs/{run}/resume" if resumed else "/runs", shows="anna")], 0)
        await asyncio.sleep(seconds)

    async def _look(self) -> None:
        pose = await self._http.get("/pose")
        if pose.status_code == 200:
            self._watch.pose(pose.json())
        answer = await self._http.get("/runs")
        if answer.status_code != 200:
            return
        self._watch.runs.listed(answer.json())
        if answer.json():
            newest = answer.json()[0]
            active = self._service.runs.active
            self._watch.runs.kept(self._folder_of(newest["id"]), under_way=active is not None)

    def _look_at_disk(self) -> None:
        for folder in (Path(self._folder.name) / "data" / "sessions").glob("*"):
            self._watch.runs.kept(folder, under_way=False)

    def _folder_of(self, run: str) -> Path:
        return Path(self._folder.name) / "data" / "sessions" / run


async def in_time(work: Awaitable[Result], what: str) -> Result:
    try:
        async with asyncio.timeout(PATIENCE):
            return await work
    except TimeoutError:
        raise AssertionError(f"{what} hangs") from None


@functools.cache
def _calibration() -> Calibration:
    """Return the calibration of the small rig, which is the same in each example."""
    with tempfile.TemporaryDirectory() as folder:
        profile = small_rig(Path(folder))
    world = make_devices(profile).world
    assert world is not None
    return calibration_of(profile, world)


def _of(ids: list[str], which: int) -> str:
    return ids[which] if which < len(ids) else "none"


TestClients = Clients.TestCase
TestClients.settings = settings(effort(12), stateful_step_count=30)
