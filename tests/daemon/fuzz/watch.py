"""What must hold, whatever happens: who moves what, what is kept of runs, and what is said of the pose."""

import asyncio
import math
from collections.abc import Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from calib import load_session
from daemon.lease import Lease
from daemon.operation.log_fields import fields_now
from daemon.procedure import RunEvent
from daemon.procedure.event_log import read_events
from daemon.service import Service
from daemon.store import RunState
from drivers.simulated.motion import Motion
from drivers.simulated.shaft import Shaft
from tests.daemon.fuzz.adversary import Adversary

SHOWN: ContextVar[str | None] = ContextVar("shown", default=None)
"""The token that the request has shown for which something is done."""
AT_ONCE = 1e-3
"""Seconds in which a motion is braked that may not go on."""

RUNNING, PAUSED = RunState.RUNNING, RunState.PAUSED
ENDS = {state for state in RunState if state.over}
ALLOWED: dict[RunState | None, set[RunState]] = {
    None: {RUNNING, RunState.FAILED, RunState.CANCELLED, RunState.INTERRUPTED},
    RUNNING: {PAUSED, *ENDS},
    PAUSED: {RUNNING, RunState.FAILED, RunState.CANCELLED, RunState.INTERRUPTED},
    RunState.SUCCEEDED: set(),
    **{state: {RUNNING, *ENDS} for state in (RunState.FAILED, RunState.CANCELLED, RunState.INTERRUPTED)},
}
"""The states that may follow each; None is that of a run that has told nothing yet."""


@dataclass
class Command:
    """What an axis was told to do, under which lease."""

    axis: str
    motion: Motion
    token: str | None


class Watch:
    """Looks at one service from its beginning to its end; what it finds is in `broken`."""

    def __init__(self, service: Service, adversary: Adversary) -> None:
        self.broken: list[str] = []
        self._service = service
        self._adversary = adversary
        self._under_way: dict[str, Command] = {}
        self._ended: dict[str, float] = {}
        self._latched = math.inf
        service.leases.on_end(self._lease_ended)
        service.rig.latch.on_engage(self._engaged)
        self._task = asyncio.create_task(self._look())

    def sees(self, axis: str, shaft: Shaft) -> None:
        """Watch what `shaft` is told to do."""
        drive = type(shaft).drive

        def seen(motion: Motion) -> None:
            self._commanded(axis, shaft.motion, motion)
            drive(shaft, motion)

        shaft.drive = seen  # type: ignore[method-assign]

    async def close(self) -> None:
        """Look no more."""
        self._task.cancel()
        await asyncio.wait([self._task])
        if not self._task.cancelled():
            self._task.result()

    def at_rest(self) -> list[str]:
        """Return the axes that move although all is over."""
        now = self._service.rig.clock.now()
        return [axis for axis, command in self._under_way.items() if now < command.motion.ends]

    def pose(self, document: dict[str, Any]) -> None:
        """Look at a pose that was given just now."""
        rig = self._service.rig
        now, allowed = rig.clock.now(), rig.profile.procedure.max_reading_age
        if document["age_s"] > allowed:
            self.broken.append(f"a pose of {document['age_s']} s ago was given")
        for axis in rig.snapshot.axes:
            name, read = axis.spec.name, axis.timestamp
            assert read is not None
            if axis.lost is not None or now - self._adversary.silent_since.get(name, now) > allowed:
                self.broken.append(f"a pose was given while axis '{name}' did not answer")
            lost = self._adversary.power_lost.get(name, -math.inf)
            if lost < read and not any(
                lost <= home.began and home.ends <= read for home in self._adversary.homings[name]
            ):
                self.broken.append(f"a pose was given while axis '{name}' was not homed")

    def runs(self, runs: Sequence[dict[str, Any]]) -> None:
        """Look at all runs, as the API lists them."""
        under_way = [run["id"] for run in runs if not RunState(run["state"]).over]
        if len(under_way) > 1:
            self.broken.append(f"two runs at once: {', '.join(under_way)}")

    def kept(self, folder: Path, *, under_way: bool) -> None:
        """Look at what is on disk of the run whose session is in `folder`."""
        if not (folder / "events.jsonl").exists():
            return
        events = read_events(folder)
        self._states(folder.name, events, under_way=under_way)
        told = [event.image for event in events if event.type == "view"]
        if not (folder / "session.json").exists():
            if told:
                self.broken.append(f"{folder.name}: views were told of, and there is no session")
            return
        session = load_session(folder)
        views = [view.image for view in (*session.views, *session.set_aside)]
        parts = sum(event.type == "state" and event.state is RUNNING for event in events)
        if missing := set(told) - set(views):
            self.broken.append(f"{folder.name}: views are lost: {missing}")
        if len(set(views) - set(told)) > parts or len(set(told)) < len(told):
            self.broken.append(f"{folder.name}: told of {told}, and kept {views}")
        if gone := [image for image in views if image is None or not (folder / image).is_file()]:
            self.broken.append(f"{folder.name}: pictures are lost: {gone}")
        for view in session.views:
            settled = (view.model_extra or {})["settle"]["settled_s"]
            if settled < self._service.profile.procedure.settle:
                self.broken.append(
                    f"{folder.name}: {view.image} was taken {settled:.3f} s after the standstill"
                )

    def _states(self, run: str, events: Sequence[RunEvent], *, under_way: bool) -> None:
        before: RunState | None = None
        for number, event in enumerate(events, 1):
            if event.sequence != number:
                self.broken.append(f"{run}: event {number} has the number {event.sequence}")
            if event.type in {"state", "finished"}:
                assert event.type == "state" or event.type == "finished"
                if event.state not in ALLOWED[before]:
                    self.broken.append(f"{run}: {event.state} follows {before}")
                before = event.state
        if not under_way and (before is None or not before.over):
            self.broken.append(f"{run}: it is over, and told {before} last")

    def _commanded(self, axis: str, before: Motion, motion: Motion) -> None:
        """Note a command; brakes and power losses may come at any time, and have one phase or none."""
        if motion.target == 0.0:  # without a phase where it stands there already
            self._adversary.homings[axis].append(motion)
        if len(motion.phases) < 2:
            self._under_way.pop(axis, None)
            return
        lease, run = self._service.leases.current, fields_now().get("run")
        holds = lease is not None and (
            lease.owner == f"run {run}" if run is not None else lease.token == SHOWN.get()
        )
        if not holds:
            self.broken.append(
                f"axis '{axis}' was moved under the lease {lease}, shown was {run or SHOWN.get()}"
            )
        if self._service.rig.latch.engaged:
            self.broken.append(f"axis '{axis}' was moved while the stop was latched")
        if before.ends > motion.began:
            self.broken.append(f"axis '{axis}' was moved while it moved")
        low, high = self._service.rig.specs[axis].limits
        if self._service.rig.axis(axis).homed and not low <= motion.target <= high:
            self.broken.append(f"axis '{axis}' was sent to {motion.target:g}")
        self._under_way[axis] = Command(axis, motion, None if lease is None else lease.token)

    async def _look(self) -> None:
        """Look at what moves whenever something has changed."""
        rig = self._service.rig
        while True:
            await rig.changed.wait()
            now = rig.clock.now()
            current = self._service.leases.current
            for axis, command in list(self._under_way.items()):
                if now >= command.motion.ends:
                    del self._under_way[axis]
                    continue
                ended = self._ended.get(command.token or "", now if current else -math.inf)
                if (current is None or current.token != command.token) and now > ended + AT_ONCE:
                    self.broken.append(f"axis '{axis}' moves on although its lease has ended")
                if rig.latch.engaged and now > self._latched + AT_ONCE:
                    self.broken.append(f"axis '{axis}' moves on although the stop is latched")

    def _lease_ended(self, lease: Lease) -> None:
        self._ended[lease.token] = self._service.rig.clock.now()

    def _engaged(self, _: str) -> None:
        self._latched = self._service.rig.clock.now()
