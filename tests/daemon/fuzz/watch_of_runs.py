"""What must hold of runs, whatever happens: one at a time, paused and stopped when asked to, and nothing lost."""

import contextlib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

from calib import load_session
from calib.session_writer import SessionWriter
from daemon.procedure import RunEvent
from daemon.procedure.event_log import EventLog, read_events
from daemon.procedure.run import Run
from daemon.service import Service
from daemon.store import RunState

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
ROUNDING = 1e-9
"""Seconds by which two times of the rig's clock may be closer than they were set to be."""
MOVES = {"homing", "joint", "moving"}
"""The events after which axes move."""


class RunWatch:
    """Looks at the runs of one service, whose folder is `sessions`; what it finds is added to `broken`.

    `moves` tells which axes a run moves now.
    """

    def __init__(
        self, service: Service, sessions: Path, broken: list[str], moves: Callable[[str], list[str]]
    ) -> None:
        self.broken = broken
        self._service = service
        self._sessions = sessions
        self._moves = moves
        self._paused: set[str] = set()
        self._stopped: set[str] = set()
        """Runs under way when everything was stopped."""
        self._unhomed: defaultdict[str, set[str]] = defaultdict(set)
        """Axes that a run that was taken up has not homed yet."""
        self._writing: Counter[Path] = Counter()
        """Views that are being written, by their session's folder."""
        service.rig.latch.on_engage(self._engaged)

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        """Hear what runs are asked for, what they write and what they tell."""
        pause, resume, add, add_pictures = Run.pause, Run.resume, EventLog.add, SessionWriter.add_pictures

        def paused(run: Run) -> None:
            pause(run)
            self._paused.add(run.record.id)

        def resumed(run: Run) -> None:
            resume(run)
            self._paused.discard(run.record.id)

        def told(log: EventLog, event: RunEvent) -> None:
            self._told(log.run_id, event)
            add(log, event)

        def written(writer: SessionWriter, *pictures: Any, **fields: Any) -> Any:
            self._writing[writer.folder] += 1
            try:
                return add_pictures(writer, *pictures, **fields)
            finally:
                self._writing[writer.folder] -= 1

        with (
            mock.patch.object(Run, "pause", paused),
            mock.patch.object(Run, "resume", resumed),
            mock.patch.object(EventLog, "add", told),
            mock.patch.object(SessionWriter, "add_pictures", written),
        ):
            yield

    def commanded(self, run: str, axis: str) -> None:
        """Look at a motion that a run has just begun."""
        if run in self._stopped:
            self.broken.append(f"{run}: it moves axis '{axis}' although a stop has ended it")
        if self._writing[self._sessions / run]:
            self.broken.append(f"{run}: it moves axis '{axis}' before its latest view is on disk")

    def started(self, problems: Sequence[str]) -> None:
        """Look at the start of a run for which was asked when the rig had `problems`."""
        if lasting := set(problems).intersection(self._service.rig.snapshot.problems):
            self.broken.append(f"a run was started although {lasting}")

    def listed(self, runs: Sequence[dict[str, Any]]) -> None:
        """Look at all runs, as the API lists them."""
        under_way = [run["id"] for run in runs if not RunState(run["state"]).over]
        if len(under_way) > 1:
            self.broken.append(f"two runs at once: {', '.join(under_way)}")

    def found(self, runs: Sequence[dict[str, Any]]) -> None:
        """Look at all runs, as the API lists them when the daemon has started: they ended as was told."""
        for run in runs:
            told = [event for event in read_events(self._sessions / run["id"]) if event.type == "finished"]
            if told and told[-1].state != run["state"]:
                self.broken.append(f"{run['id']}: {told[-1].state} was told, and {run['state']} is stored")

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
            if settled < self._service.profile.procedure.settle - ROUNDING:
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

    def _told(self, run: str, event: RunEvent) -> None:
        """Look at what a run is about to tell."""
        if event.type in {*MOVES, "solving"} and run in self._paused:
            self.broken.append(f"{run}: it goes on with {event.type} although it was paused")
        if event.type == "plan":
            taken = any(earlier.type == "view" for earlier in read_events(self._sessions / run))
            self._unhomed[run] = set(self._service.rig.specs) if taken else set()
        elif event.type == "homing":
            self._unhomed[run].discard(event.axis)
        elif event.type in MOVES and self._unhomed[run]:
            self.broken.append(f"{run}: it was taken up, and {self._unhomed[run]} was not homed")
        elif event.type == "view":
            self._view(run, event.image)
        elif event.type == "finished":
            self._paused.discard(run)
            self._stopped.discard(run)
            self._finished(run, event.error or "")

    def _view(self, run: str, image: str) -> None:
        folder = self._sessions / run
        views = [view.image for view in load_session(folder).views]
        if image not in views or not (folder / image).is_file():
            self.broken.append(f"{run}: {image} is told of and not on disk")

    def _finished(self, run: str, error: str) -> None:
        moving = self._moves(run)
        if moving and "could not be confirmed" not in error:
            self.broken.append(f"{run}: it is over, and {moving} moves")
        lease = self._service.leases.current
        if lease is not None and lease.owner == f"run {run}":
            self.broken.append(f"{run}: it is over, and has the lease")

    def _engaged(self, _: str) -> None:
        run = self._service.runs.active
        if run is not None and run.assignment.moves:
            self._stopped.add(run.record.id)
