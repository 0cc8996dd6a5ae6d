"""What a run is to do: measure and solve, or solve what an earlier run has measured."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from calib.observations import Observation
from calib.session_writer import SessionWriter
from daemon.procedure.conclusion import Conclusion, conclude
from daemon.procedure.event_log import EventLog
from daemon.procedure.events import StateChanged
from daemon.profile.profile import NOWHERE_ELSE
from daemon.rig import Rig
from daemon.store import RunRecord, RunState
from drivers.cancellation import finish

if TYPE_CHECKING:
    from daemon.procedure.survey import Survey

Checkpoint = Callable[[], Awaitable[None]]
Note = Callable[[str, Observation], None]
"""Takes what was found in a picture, by the picture's name."""
End = tuple[RunState, str | None]

UNSOLVED = "its views could not be solved: "


class Assignment(Protocol):
    """What a run does between its first and its last event."""

    @property
    def moves(self) -> bool:
        """Whether it moves axes: under a lease of its own, and ended by a stop."""

    @property
    def activates(self) -> bool:
        """Whether poses are computed from what it finds, unless somebody decides otherwise."""

    @property
    def takes_views(self) -> bool:
        """Whether it will come to a checkpoint again, where it may be paused."""

    @property
    def remedy(self) -> str:
        """What to ask for once it was cut off, and what had cut it off is over."""

    async def work(self, log: EventLog, checkpoint: Checkpoint) -> Conclusion:
        """Do it; raises errors of the project's trees and OSError."""

    async def halt(self) -> None:
        """Return when whatever it moved is confirmed to stand; raises StandstillError."""

    def end(self, state: RunState, error: str | None) -> End:
        """Return how a run ends whose work ended so."""


class Calibrate:
    """Take the views that the session in `folder` lacks, and solve it; its calibration is to be used.

    `note` is called with what is found in each picture. `starts`, as for `Procedure.starting`, are those of a new
    session; one that there is has its own.
    """

    moves = True
    activates = True
    remedy = "resume the run, or solve the views taken so far as they are"

    def __init__(
        self, rig: Rig, folder: Path, note: Note, starts: Mapping[str, Sequence[float]] = NOWHERE_ELSE
    ) -> None:
        self.takes_views = True
        self._note = note
        self._rig = rig
        self._folder = folder
        self._starts = starts

    async def work(self, log: EventLog, checkpoint: Checkpoint) -> Conclusion:
        """Measure and solve."""
        writer = await finish(asyncio.to_thread(self._writer))
        log.add(StateChanged(state=RunState.RUNNING))
        # What the starter had in motion ended with the lease that was handed over, and may still be braking.
        await self._rig.stop_axes(list(self._rig.specs))
        if not writer.session.complete:
            survey = await finish(asyncio.to_thread(_survey))
            await survey(self._rig, writer, log, checkpoint, self._note).take()
        await checkpoint()
        self.takes_views = False
        return await conclude(self._folder, log)

    async def halt(self) -> None:
        """Stop all axes."""
        await self._rig.stop_axes(list(self._rig.specs))

    def end(self, state: RunState, error: str | None) -> End:
        """End as the work did."""
        return state, error

    def _writer(self) -> SessionWriter:
        if (self._folder / "session.json").exists():
            return SessionWriter.resume(self._folder)
        return SessionWriter(self._folder, self._rig.profile.empty_session(self._starts))


def _survey() -> "type[Survey]":
    from daemon.procedure.survey import Survey  # and all that finds targets, beside the event loop

    return Survey


class Solve:
    """Solve the session in `folder` as it is, but for the views `left_out`. The run stays what it was."""

    moves = False
    activates = False
    takes_views = False
    remedy = "solve its views again"

    def __init__(self, before: RunRecord, folder: Path, left_out: Sequence[int] = ()) -> None:
        self._before = before
        self._folder = folder
        self._left_out = left_out

    async def work(self, log: EventLog, checkpoint: Checkpoint) -> Conclusion:  # noqa: ARG002
        """Solve."""
        log.add(StateChanged(state=RunState.RUNNING))
        return await conclude(self._folder, log, self._left_out)

    async def halt(self) -> None:
        """Leave the axes to whoever moves them."""

    def end(self, state: RunState, error: str | None) -> End:
        """End as the run did before."""
        before = (self._before.error or "").partition(UNSOLVED)[0].removesuffix("; ")
        unsolved = "" if state is RunState.SUCCEEDED else f"{UNSOLVED}{error}"
        return self._before.state, "; ".join(filter(None, (before, unsolved))) or None
