"""Daemons that are killed in the middle of runs: `python -m tests.daemon.kills COUNT [SEED]`.

All use one data folder, one after the other. Each starts a run, or takes up one that an earlier one left: resumes it,
or solves it as it is. What the killed one told is compared with what is on disk, and with what the next one says when
it starts.
"""

import asyncio
import logging
import multiprocessing
import random
import sys
import tempfile
import time
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Literal

import cv2

from calib import load_session
from daemon.procedure.event_log import read_events
from daemon.procedure.events import EVENT, RunEvent
from daemon.profile import load_profile
from daemon.service import running_service
from daemon.store import RunState
from tests.daemon.rigs import write_profile
from tests.daemon.runs import of

# Forks of a process that has imported everything: a daemon is there in a tenth of the time.
PROCESSES = multiprocessing.get_context("forkserver")
PROCESSES.set_forkserver_preload([__name__, "calib.solver"])

Action = Literal["start", "resume", "solve"]
EVENTS: dict[Action, int] = {"start": 42, "resume": 42, "solve": 16}
"""About how many there are to the end."""
LATE = 0.05
"""Seconds after an event within which the kill comes."""


@dataclass
class Told:
    """What a daemon that was to do `action` has told until it was killed."""

    action: Action = "start"
    up: bool = False
    """Whether it had started."""
    unfinished: list[str] = field(default_factory=list)
    """The runs that it found unfinished when it started, by what it logged."""
    calibration: str | None = None
    """The one in use then."""
    run: str | None = None
    events: list[RunEvent] = field(default_factory=list)

    @property
    def finished(self) -> bool:
        """Whether its run had come to an end; the missing one of an earlier part comes before it began."""
        return bool(of(self.events, "state")) and self.events[-1].type == "finished"

    @property
    def concluding(self) -> bool:
        """Whether the end may have been stored without having been told: what has too few views fails at once."""
        at_once = self.action == "solve" and bool(self.events) and self.events[-1].type == "state"
        return (at_once or bool(of(self.events, "solved"))) and not self.finished


@dataclass(frozen=True)
class Asked:
    """What a daemon is to do: with no run, or one whose events up to `after` have been told."""

    action: Action
    run: str | None
    after: int


def live(folder: Path, data: Path, asked: Asked, pipe: Connection) -> None:
    """Be a daemon that tells through `pipe` what it does, until it is killed."""

    class Warnings(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            pipe.send(("log", record.getMessage()))

    logging.getLogger("daemon").addHandler(Warnings(logging.WARNING))
    asyncio.run(_live(folder, data, asked, pipe))


async def _live(folder: Path, data: Path, asked: Asked, pipe: Connection) -> None:
    async with running_service(load_profile(str(folder / "small-rig.toml")), data) as service:
        pipe.send(("up", service.poses.calibration_id))
        if asked.run is None:
            run = await service.runs.start()
        elif asked.action == "resume":
            run = await service.runs.resume(asked.run)
        else:
            run = await service.runs.solve(asked.run)
        pipe.send(("run", run.id))
        async for event in service.runs.events(run.id, asked.after):
            pipe.send(("event", event.model_dump_json()))
        pipe.send(("over", None))
        await asyncio.Event().wait()


def kill_one(folder: Path, data: Path, asked: Asked, moment: int, late: float) -> Told:
    """Let a daemon live until it has told `moment` events and some seconds more, and return what it told."""
    here, there = PROCESSES.Pipe(duplex=False)
    process = PROCESSES.Process(target=live, args=(folder, data, asked, there))
    process.start()
    there.close()
    told = Told(asked.action)
    while not (told.up and len(told.events) >= moment) and _hear(here, told):
        pass
    time.sleep(late)
    process.kill()
    process.join()
    while _hear(here, told):
        pass
    here.close()
    return told


def _hear(pipe: Connection, told: Told) -> bool:
    """Take one message in; return whether there may be more to wait for."""
    try:
        kind, what = pipe.recv()
    except EOFError:
        return False
    if kind == "log" and "was interrupted" in what:
        told.unfinished.append(what.split("'")[1])
    elif kind == "up":
        told.up, told.calibration = True, what
    elif kind == "run":
        told.run = what
    elif kind == "event":
        told.events.append(EVENT.validate_json(what))
    return bool(kind != "over")


class Kills:
    """One data folder, the daemons that were killed over it, and what must be in it."""

    def __init__(self, folder: Path, seed: int) -> None:
        self._folder = folder
        self._data = folder / "data"
        self._random = random.Random(seed)
        self._killed = Told()
        self._cut_off: list[str] = []
        write_profile(folder)

    def once(self) -> str:
        """Let one daemon live and die; return what was found. Raises AssertionError where something is lost."""
        action: Action = self._random.choice(["start", "resume", "solve"]) if self._cut_off else "start"
        run_id = None if action == "start" else self._random.choice(self._cut_off)
        asked = Asked(action, run_id, 0 if run_id is None else len(self._events(run_id)))
        moment, late = self._random.randrange(EVENTS[action]), self._random.uniform(0, LATE)
        told = kill_one(self._folder, self._data, asked, moment, late)
        assert told.up
        self._check_start(told)
        views = "none" if told.run is None else self._check_disk(told)
        self._note(told)
        last = told.events[-1].type if told.events else "nothing"
        return (
            f"{action}, killed {1e3 * late:.0f} ms after event {len(told.events)} ({last}): views on disk {views}; "
            f"found unfinished at the start: {', '.join(told.unfinished) or 'none'}"
        )

    async def finish(self) -> str:
        """Resume the last run that was cut off, if any, and return how it ended."""
        async with running_service(load_profile(str(self._folder / "small-rig.toml")), self._data) as service:
            runs = await service.runs.list()
            assert not [run.id for run in runs if not run.state.over]
            left = [run for run in runs if run.state is RunState.INTERRUPTED]
            if not left:
                return "no run was left to resume"
            run = await service.runs.resume(left[0].id)
            run = await service.runs.wait(run.id)
            assert run.state is RunState.SUCCEEDED, run.error
            assert service.poses.calibration_id == run.calibration_id
            return f"run '{run.id}' was resumed to its end"

    def _check_start(self, told: Told) -> None:
        """What a daemon says when it starts is what the one before it left."""
        before = self._killed
        if before.finished:
            assert told.unfinished == [], told.unfinished
        elif before.run is not None and not before.concluding:
            assert told.unfinished == [before.run], (told.unfinished, before.run)
        assert len(told.unfinished) <= 1
        ends = [event for event in of(before.events, "finished") if event.state is RunState.SUCCEEDED]
        if ends:
            assert told.calibration == ends[-1].calibration_id
        elif not before.concluding:
            assert told.calibration == before.calibration

    def _check_disk(self, told: Told) -> str:
        """Every view and event that was told of is there, each view with its picture."""
        assert told.run is not None
        written = self._events(told.run)
        for event in told.events:
            assert written[event.sequence - 1] == event, event
        folder = self._data / "sessions" / told.run
        if not (folder / "session.json").exists():
            assert not of(told.events, "view")
            return "none"
        session = load_session(folder)
        views = [*session.views, *session.set_aside]
        assert {event.image for event in of(written, "view")} <= {view.image for view in views}
        assert all(cv2.imread(str(folder / name)) is not None for view in views for name in view.frames)
        return f"{len(session.views)} and {len(session.set_aside)} set aside"

    def _note(self, told: Told) -> None:
        self._killed = told
        if told.run is None:
            return
        if told.run in self._cut_off:
            self._cut_off.remove(told.run)
        ends = of(told.events, "finished")
        if not (ends and ends[-1].state is RunState.SUCCEEDED) and not told.concluding:
            self._cut_off.append(told.run)

    def _events(self, run_id: str) -> list[RunEvent]:
        return read_events(self._data / "sessions" / run_id)


def main(count: int, seed: int) -> None:
    """Print what was found each time."""
    with tempfile.TemporaryDirectory() as name:
        kills = Kills(Path(name), seed)
        for number in range(1, count + 1):
            print(f"{number}: {kills.once()}", flush=True)  # noqa: T201
        print(asyncio.run(kills.finish()))  # noqa: T201


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0)
