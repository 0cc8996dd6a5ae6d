"""What must hold, whatever happens, of what moves and under which lease, and of what is said of the pose."""

import asyncio
import contextlib
import math
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from daemon.lease import Lease
from daemon.operation.log_fields import fields_now
from daemon.service import Service
from drivers.simulated.motion import Motion
from drivers.simulated.shaft import Shaft
from tests.daemon.fuzz.adversary import Adversary
from tests.daemon.fuzz.watch_of_runs import RunWatch

SHOWN: ContextVar[str | None] = ContextVar("shown", default=None)
"""The token that the request has shown for which something is done."""
AT_ONCE = 1e-3
"""Seconds in which a motion is braked that may not go on."""


@dataclass
class Command:
    """What an axis was told to do, under which lease, and by which run."""

    axis: str
    motion: Motion
    token: str | None
    run: str | None


class Watch:
    """Looks at one service, with its `sessions`, from its beginning to its end; what it finds is in `broken`."""

    def __init__(self, service: Service, adversary: Adversary, sessions: Path) -> None:
        self.broken: list[str] = []
        self.runs = RunWatch(service, sessions, self.broken, self._moved_by)
        self._service = service
        self._adversary = adversary
        self._under_way: dict[str, Command] = {}
        self._ended: dict[str, float] = {}
        self.stops = 0
        """How often everything was stopped."""
        self._latched = math.inf
        self._away: dict[str, float] = {}
        """Until when each axis was lost, and may have been moved by hand (rig's clock, s)."""
        service.leases.on_end(self._lease_ended)
        service.rig.latch.on_engage(self._engaged)
        self._stack = contextlib.ExitStack()
        self._stack.enter_context(self.runs.listening())
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
        self._stack.close()
        self._task.cancel()
        await asyncio.wait([self._task])
        if not self._task.cancelled():
            self._task.result()

    def at_rest(self) -> list[str]:
        """Return the axes that move although all is over."""
        return [command.axis for command in self._moving()]

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
            lost = max(self._adversary.power_lost.get(name, -math.inf), self._away.get(name, -math.inf))
            if lost < read and not any(
                lost <= home.began and home.ends <= read for home in self._adversary.homings[name]
            ):
                self.broken.append(f"a pose was given while axis '{name}' was not homed")

    def _commanded(self, axis: str, before: Motion, motion: Motion) -> None:
        """Note a command; brakes and power losses may come at any time, and have one phase or none."""
        if motion.target == 0.0:  # without a phase where it stands there already
            self._adversary.homings[axis].append(motion)
        if len(motion.phases) < 2:
            self._under_way.pop(axis, None)
            return
        lease, run = self._service.leases.current, fields_now().get("run")
        token = lease.token if lease is not None and lease.owner == f"run {run}" else SHOWN.get()
        held = lease is not None and lease.token == token
        # What was on its way when the lease ended is to be braked, as all that moves then.
        if not held and motion.began > self._ended.get(token or "", -math.inf) + AT_ONCE:
            self.broken.append(f"axis '{axis}' was moved under the lease {lease}, shown was {run or token}")
        if self._service.rig.latch.engaged:
            self.broken.append(f"axis '{axis}' was moved while the stop was latched")
        if before.ends > motion.began:
            self.broken.append(f"axis '{axis}' was moved while it moved")
        low, high = self._service.rig.specs[axis].limits
        if self._service.rig.axis(axis).homed and not low <= motion.target <= high:
            self.broken.append(f"axis '{axis}' was sent to {motion.target:g}")
        if run is not None:
            self.runs.commanded(run, axis)
        self._under_way[axis] = Command(axis, motion, token, run)

    def _moving(self) -> list[Command]:
        now = self._service.rig.clock.now()
        return [command for command in self._under_way.values() if now < command.motion.ends]

    def _moved_by(self, run: str) -> list[str]:
        return [command.axis for command in self._moving() if command.run == run]

    async def _look(self) -> None:
        """Look at what moves whenever something has changed."""
        rig = self._service.rig
        while True:
            await rig.changed.wait()
            now = rig.clock.now()
            current = self._service.leases.current
            self._away |= {axis.spec.name: now for axis in rig.snapshot.axes if axis.lost and axis.timestamp}
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
        self.stops += 1
        self._latched = self._service.rig.clock.now()
