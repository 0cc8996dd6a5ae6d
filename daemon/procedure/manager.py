"""The runs of a rig: one at a time, each under a lease of its own."""

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace
from functools import partial

from calib import Calibration
from calib.observations import Observation
from daemon.errors import RigFaultError, RunActiveError, RunStateError, StoreError
from daemon.lease import Lease, LeaseDesk
from daemon.procedure.assignment import Assignment, Calibrate, Solve
from daemon.procedure.beginning import new_record, require_same_profile
from daemon.procedure.event_log import EventLog, Told
from daemon.procedure.measured import require_views
from daemon.procedure.plan import starts_here
from daemon.procedure.run import Run
from daemon.procedure.run_book import RunBook
from daemon.rig import Rig
from daemon.store import CalibrationRecord, RunRecord, RunState, Store

logger = logging.getLogger(__name__)

Activate = Callable[[CalibrationRecord, Calibration], None]
Seen = Callable[[str, str, Observation], None]


class RunManager(RunBook):
    """Starts and steers runs.

    `activate` is called with the calibration of a run that has succeeded, before its last event is told; `told`
    with every event; `seen` with what was found in a picture, by the run's id and the picture's name.
    """

    def __init__(
        self, rig: Rig, leases: LeaseDesk, store: Store, activate: Activate, told: Told, seen: Seen
    ) -> None:
        super().__init__(store)
        self._rig = rig
        self._leases = leases
        self._activate = activate
        self._told = told
        self._seen = seen
        self._starting = asyncio.Lock()
        self._closed = False
        self._stops = 0
        """How many times everything was stopped."""
        rig.latch.on_engage(self._stop)

    async def start(
        self, owner: str = "", note: str = "", token: str | None = None, from_here: Sequence[str] = ()
    ) -> RunRecord:
        """Start the profile's whole procedure; `token` shows the starter's lease, if there is one.

        Sweeps of the joints `from_here` start from where the axes stand now, as `Procedure.starting` has it. Before
        anything moves, raises RunActiveError, RunStateError, StopLatchedError, RigFaultError, LeaseHeldError and
        StoreError; and for those joints what `starts_here` raises, and AxisBusyError.
        """
        async with self._starting:
            await self.settle()
            self._require_able()
            starts = starts_here(self._rig, from_here)
            for start in starts.values():
                self._rig.check_move(dict(zip(self._rig.specs, start, strict=True)))
            record = new_record(self._rig.profile, owner, note)
            folder = self._store.session_folder(record)

            async def take_up() -> EventLog:
                await self._store.add_run(record)
                return EventLog(record.id, folder)

            return await self._begin(
                record, Calibrate(self._rig, folder, partial(self._seen, record.id), starts), take_up, token
            )

    async def resume(self, run_id: str, token: str | None = None) -> RunRecord:
        """Let a paused run go on; take up one that ended before its time after the last sweep that it finished.

        `token` shows the lease of who asks, if there is one. Raises UnknownRunError, ProfileChangedError and what
        `start` raises.
        """
        if self.active is not None and self.active.record.id == run_id:
            self._rig.latch.require_free()
            self.active.resume()
            return self.active.record
        async with self._starting:
            await self.settle()
            before = await self._require_unfinished(run_id)
            self._require_able()
            require_same_profile(before, self._rig.profile)
            folder = self._store.session_folder(before)
            assignment = Calibrate(self._rig, folder, partial(self._seen, run_id))
            return await self._begin(before, assignment, lambda: self._take_up(before), token)

    async def solve(self, run_id: str, left_out: Sequence[int] = ()) -> RunRecord:
        """Solve what a run that is over has measured, but for the views `left_out`.

        The run stays what it was, and its calibration is stored and not activated. Raises UnknownRunError,
        UnknownViewError, SessionUnreadableError, RunActiveError, RunStateError and StoreError.
        """
        async with self._starting:
            await self.settle()
            before = await self.get(run_id)
            self._require_free()
            folder = self._store.session_folder(before)
            if left_out:
                await asyncio.to_thread(require_views, before, folder, left_out)
            assignment = Solve(before, folder, left_out)
            return await self._begin(before, assignment, lambda: self._take_up(before))

    async def settle(self) -> None:
        """Store how runs have ended that the store takes for unfinished, unless one is under way; raises StoreError."""
        if self.active is not None:
            return
        if self._latest is not None:
            await self._latest.store_end()
        for run in await self._store.interrupt_unfinished():
            logger.warning("run '%s' was interrupted: %s", run.id, run.error)

    def pause(self, run_id: str) -> None:
        """Let a run that takes views come to rest after the one in flight; raises RunStateError."""
        self._require_active(run_id).pause()

    async def cancel(self, run_id: str) -> RunRecord:
        """End a run, and return when its axes stand; raises RunStateError."""
        run = self._require_active(run_id)
        await run.end(RunState.CANCELLED, "it was cancelled")
        return run.record

    async def close(self) -> None:
        """Start no more runs, interrupt the one under way, if any, and return when its axes stand."""
        self._closed = True
        async with self._starting:  # one that is about to begin is to be ended, too
            pass
        if self.active is not None:
            await self.active.end(
                RunState.INTERRUPTED, f"the daemon was shut down: {self.active.assignment.remedy}"
            )
        if self._latest is not None:
            with contextlib.suppress(StoreError):  # the next daemon finds it unfinished then
                await self._latest.store_end()

    async def _begin(
        self,
        record: RunRecord,
        assignment: Assignment,
        take_up: Callable[[], Awaitable[EventLog]],
        token: str | None = None,
    ) -> RunRecord:
        """Start a run, under a lease of its own where it moves, once `take_up` has stored that it is under way."""
        stops = self._stops
        handing_over = (
            self._leases.handing_over(f"run {record.id}", record.note, token)
            if assignment.moves
            else contextlib.nullcontext()
        )
        with handing_over as lease:
            log = await take_up()
        log.listen(self._told)
        running = replace(record, state=RunState.RUNNING, ended_at=None, error=None)
        self._latest = Run(running, assignment, log, self._store, self._end_of(lease))
        self._latest.start()
        if self._stops > stops and assignment.moves:  # perhaps acknowledged by now
            self._latest.break_off(RunState.FAILED, "a stop ended it while it began")
        return running

    async def _take_up(self, before: RunRecord) -> EventLog:
        """Store that a run is under way again, and return its events so far."""
        folder = self._store.session_folder(before)
        told = self._latest.log if self._latest is not None and self._latest.record.id == before.id else None
        try:
            log = await asyncio.to_thread(EventLog.reopen, before, folder, told)
        except OSError as error:
            raise StoreError(f"{folder}: the run's events cannot be written: {error.strerror}") from error
        if before.state is not RunState.SUCCEEDED:  # which one that is solved again remains, whatever comes
            await self._store.change_run(before.id, RunState.RUNNING)
        return log

    def _stop(self, reason: str) -> None:
        self._stops += 1
        # Whatever it is doing: a run that only found out at its next motion would go on once the stop is
        # acknowledged.
        if self.active is not None and self.active.assignment.moves:
            self.active.break_off(RunState.FAILED, f"a stop ended it: {reason}")

    def _require_able(self) -> None:
        self._require_free()
        self._rig.latch.require_free()
        problems = self._rig.snapshot.problems
        if problems:
            raise RigFaultError(f"no run can be started: {'; '.join(problems)}")

    def _require_free(self) -> None:
        if self._closed:
            raise RunStateError("no run can be started any more: the daemon is shutting down")
        if self.active is not None:
            raise RunActiveError(f"run '{self.active.record.id}' is under way: wait for it, or cancel it")

    async def _require_unfinished(self, run_id: str) -> RunRecord:
        """Return a run that is over and has not succeeded; raises UnknownRunError, RunStateError and StoreError."""
        record = await self.get(run_id)
        if record.state is RunState.SUCCEEDED:
            raise RunStateError(f"run '{run_id}' has succeeded: start another")
        return record

    def _require_active(self, run_id: str) -> Run:
        run = self.active
        if run is None or run.record.id != run_id:
            raise RunStateError(f"run '{run_id}' is not under way")
        return run

    def _end_of(self, lease: Lease | None) -> Callable[[CalibrationRecord | None, Calibration | None], None]:
        def end(record: CalibrationRecord | None, calibration: Calibration | None) -> None:
            if record is not None and record.active and calibration is not None:
                self._activate(record, calibration)
            if lease is not None:
                self._leases.release(lease.token)

        return end
