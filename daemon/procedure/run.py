"""One calibration run, from its first move to its last word."""

import asyncio
import contextlib
import errno
import logging
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from uuid import uuid4

from calib import Calibration
from calib.documents import write_json
from calib.errors import CalibError
from daemon.errors import DaemonError, RunStateError, StandstillError, StoreError
from daemon.operation.log_fields import log_fields
from daemon.procedure.assignment import Assignment
from daemon.procedure.conclusion import Conclusion
from daemon.procedure.event_log import EventLog
from daemon.procedure.events import Finished, StateChanged
from daemon.procedure.gate import Gate
from daemon.rig.wording import unconfirmed
from daemon.store import CalibrationRecord, RunRecord, RunState, Store
from drivers.cancellation import finish
from drivers.errors import DriverError

logger = logging.getLogger(__name__)

OnEnd = Callable[[CalibrationRecord | None, Calibration | None], None]


class Run:
    """A run under way: running -> (paused -> running)* -> succeeded, failed, cancelled or interrupted.

    The end is stored before it is told, and comes only when the axes are confirmed to stand, or its error
    says that they could not be. `on_end` is called between the two, with what a run that succeeded has found.
    """

    def __init__(
        self, record: RunRecord, assignment: Assignment, log: EventLog, store: Store, on_end: OnEnd
    ) -> None:
        self.record = record
        self.folder = store.session_folder(record)
        self.log = log
        self.assignment = assignment
        self._store = store
        self._on_end = on_end
        self._gate = Gate()
        self._ending: tuple[RunState, str] | None = None
        self._task: asyncio.Task[None] | None = None
        self._begun = False
        self._stored = True

    def start(self) -> asyncio.Task[None]:
        """Begin; the task ends with the run and never fails."""
        with log_fields(run=self.record.id):
            self._task = asyncio.create_task(self._execute(), name=f"run {self.record.id}")
        return self._task

    def pause(self) -> None:
        """Let the run come to rest after the view in flight.

        Raises RunStateError when it is to already, and when it takes no more views.
        """
        if not self.assignment.takes_views:
            raise RunStateError(f"run '{self.record.id}' only computes by now: wait for it, or cancel it")
        if self._gate.closed:
            raise RunStateError(f"run '{self.record.id}' is paused, or will be after the view in flight")
        self._gate.close()

    def resume(self) -> None:
        """Let the run go on; raises RunStateError when it is not paused."""
        if not self._gate.closed:
            raise RunStateError(f"run '{self.record.id}' is not paused")
        self._gate.open()

    def break_off(self, state: RunState, why: str) -> None:
        """Stop the run for good, whatever it is doing; the first to ask says how it ends."""
        if self._ending is not None or self._task is None:
            return
        self._ending = state, why
        # A task that is cancelled before its first step would never come to its end's duties.
        if self._begun:
            self._task.cancel()

    async def end(self, state: RunState, why: str) -> None:
        """Break the run off, and return when its axes stand and its end is stored."""
        self.break_off(state, why)
        if self._task is not None:
            await asyncio.wait([self._task])

    async def store_end(self) -> None:
        """Store the run's end if the store did not take it when it came; raises StoreError."""
        if not self._stored:
            ended = self.record
            self.record = await self._store.change_run(ended.id, ended.state, ended.error)
            self._stored = True

    async def _execute(self) -> None:
        self._begun = True
        state, error, conclusion = RunState.SUCCEEDED, None, None
        try:
            if self._ending is None:
                conclusion = await self.assignment.work(self.log, self._checkpoint)
        except asyncio.CancelledError:
            state, error = RunState.CANCELLED, "it was cancelled"
        except (DaemonError, DriverError, CalibError) as failure:
            state, error = RunState.FAILED, str(failure)
        except OSError as failure:
            state, error = RunState.FAILED, self._unwritten(failure)
        except Exception as failure:
            logger.exception("run '%s' failed", self.record.id)
            state, error = RunState.FAILED, f"an error in the program, which its log describes: {failure!r}"
        if conclusion is None and self._ending is not None:
            # Whatever it was that the breaking off made go wrong.
            state, error = self._ending
        await finish(self._conclude(state, error, conclusion))

    async def _checkpoint(self) -> None:
        while self._gate.closed:  # again, where it was paused while that it goes on was being stored
            await self._change(RunState.PAUSED)
            await self._gate.wait_open()
            await self._change(RunState.RUNNING)

    async def _change(self, state: RunState) -> None:
        self.record = await self._store.change_run(self.record.id, state)
        self.log.add(StateChanged(state=state))

    async def _conclude(self, state: RunState, error: str | None, conclusion: Conclusion | None) -> None:
        """Make sure that the axes stand, store the end, and tell it."""
        if state is not RunState.SUCCEEDED:
            try:
                await self.assignment.halt()
            except StandstillError as unsure:
                error = f"{error}; {unconfirmed(unsure.reasons, str(error))}"
        ended, told = self.assignment.end(state, error)
        kept: CalibrationRecord | None = None
        try:
            kept = None if conclusion is None else await self._keep(conclusion, ended)
            self.record = await self._store.change_run(self.record.id, ended, told, calibration=kept)
        except (DaemonError, OSError) as failure:
            why = self._unwritten(failure) if isinstance(failure, OSError) else str(failure)
            unstored = f"its end could not be stored: {why}"
            ended, told = self.assignment.end(
                RunState.FAILED if state is RunState.SUCCEEDED else state,
                unstored if error is None else f"{error}; {unstored}",
            )
            kept = None
            self.record = replace(self.record, state=ended, error=told, ended_at=datetime.now(UTC))
            self._stored = False
            with contextlib.suppress(StoreError):
                await self.store_end()
        if kept is None or conclusion is None:
            logger.warning("run '%s' %s: %s", self.record.id, self.record.state, told)
        else:
            solved = "succeeded" if kept.active else "was solved as it is"
            logger.info("run '%s' %s: %s", self.record.id, solved, conclusion.calibration.quality.verdict)
        self._on_end(kept, None if conclusion is None else conclusion.calibration)
        self.log.add(Finished(state=self.record.state, error=told, calibration_id=self.record.calibration_id))

    async def _keep(self, conclusion: Conclusion, state: RunState) -> CalibrationRecord:
        """Write the calibration beside its session, and return the record that goes into the store.

        It is to be used where the run has succeeded; one of a run that was cut off, or of other views than a run
        was planned with, is for a person to judge.
        """
        calibration = conclusion.calibration
        await asyncio.to_thread(write_json, self.folder / "calibration.json", calibration)
        return CalibrationRecord(
            id=uuid4().hex,
            created_at=datetime.now(UTC),
            method=calibration.method,
            active=state is RunState.SUCCEEDED and self.assignment.activates,
            run_id=self.record.id,
            document=calibration.model_dump_json(exclude_unset=True),
            verification=conclusion.verification_json(),
        )

    def _unwritten(self, error: OSError) -> str:
        """Return why what the run has measured or found could not be written, and what to do."""
        if error.errno in {errno.ENOSPC, errno.EDQUOT}:
            return (
                f"the disk is full: {error.filename} could not be written: "
                f"make room, then {self.assignment.remedy}"
            )
        return f"the session could not be written: {error.filename}: {error.strerror}"
