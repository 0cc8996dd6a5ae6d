"""The runs of a rig: one at a time, each under a lease of its own."""

import asyncio
import secrets
from collections.abc import AsyncIterator, Callable, Sequence
from datetime import UTC, datetime

from calib import Calibration
from daemon.errors import RigFaultError, RunActiveError, RunStateError
from daemon.lease import LeaseDesk
from daemon.procedure.event_log import read_events
from daemon.procedure.events import Finished, RunEvent
from daemon.procedure.run import Run
from daemon.profile_document import ProfileDocument
from daemon.rig import Rig
from daemon.store import CalibrationRecord, RunRecord, RunState, Store

Activate = Callable[[CalibrationRecord, Calibration], None]


class RunManager:
    """Starts and steers runs, and knows those of the past.

    `activate` is called with the calibration of a run that has succeeded, before its last event is told.
    """

    def __init__(self, rig: Rig, leases: LeaseDesk, store: Store, activate: Activate) -> None:
        self._rig = rig
        self._leases = leases
        self._store = store
        self._activate = activate
        self._latest: Run | None = None
        self._starting = asyncio.Lock()
        self._closed = False
        rig.latch.on_engage(self._stop)

    @property
    def active(self) -> Run | None:
        """The run under way, if any."""
        latest = self._latest
        return None if latest is None or latest.record.state.over else latest

    async def start(self, owner: str = "", note: str = "", token: str | None = None) -> RunRecord:
        """Start the profile's whole procedure; `token` shows the starter's lease, if there is one.

        Before anything moves, raises RunActiveError, RunStateError, StopLatchedError, RigFaultError,
        LeaseHeldError and StoreError.
        """
        async with self._starting:
            self._require_able()
            record = self._new_record(owner, note)
            lease = self._leases.hand_over(f"run {record.id}", note, token)
            try:
                await self._store.add_run(record)
            except BaseException:
                self._leases.release(lease.token)
                raise
            self._latest = Run(record, self._rig, self._store, self._end_of(lease.token))
            self._latest.start()
            return record

    def pause(self, run_id: str) -> None:
        """Let a run come to rest after the view in flight; raises RunStateError."""
        self._require_active(run_id).pause()

    def resume(self, run_id: str) -> None:
        """Let a paused run go on; raises RunStateError, StopLatchedError."""
        self._rig.latch.require_free()
        self._require_active(run_id).resume()

    async def cancel(self, run_id: str) -> RunRecord:
        """End a run, and return when its axes stand; raises RunStateError."""
        run = self._require_active(run_id)
        await run.end(RunState.CANCELLED, "it was cancelled")
        return run.record

    async def wait(self, run_id: str) -> RunRecord:
        """Return the run when it is over; raises UnknownRunError."""
        async for _ in self.events(run_id):
            pass
        return await self.get(run_id)

    async def get(self, run_id: str) -> RunRecord:
        """Return one run; raises UnknownRunError."""
        if self._latest is not None and self._latest.record.id == run_id:
            return self._latest.record
        return await self._store.run(run_id)

    async def list(self) -> Sequence[RunRecord]:
        """Return all runs, the newest first."""
        # The store may not have taken the latest's end, which only its own record tells then.
        latest = None if self._latest is None else self._latest.record
        return [latest if latest and latest.id == run.id else run for run in await self._store.runs()]

    async def events(self, run_id: str, after: int = 0) -> AsyncIterator[RunEvent]:
        """Yield a run's events whose sequence is greater than `after`, and follow it to its end.

        Raises UnknownRunError.
        """
        if self._latest is not None and self._latest.record.id == run_id:
            async for event in self._latest.log.follow(after):
                yield event
            return
        record = await self._store.run(run_id)
        events = await asyncio.to_thread(read_events, self._store.session_folder(record))
        if not events or events[-1].type != "finished":
            events.append(_missing_end(record, len(events) + 1))
        for event in events:
            if event.sequence > after:
                yield event

    async def close(self) -> None:
        """Start no more runs, interrupt the one under way, if any, and return when its axes stand."""
        self._closed = True
        if self.active is not None:
            await self.active.end(
                RunState.INTERRUPTED,
                "the daemon was shut down: the views taken so far can be solved as they are",
            )

    def _stop(self, reason: str) -> None:
        # Whatever it is doing: a run that only found out at its next motion would go on once the stop is
        # acknowledged.
        if self.active is not None:
            self.active.break_off(RunState.FAILED, f"a stop ended it: {reason}")

    def _require_able(self) -> None:
        if self._closed:
            raise RunStateError("no run can be started any more: the daemon is shutting down")
        if self.active is not None:
            raise RunActiveError(f"run '{self.active.record.id}' is under way: wait for it, or cancel it")
        self._rig.latch.require_free()
        problems = self._rig.snapshot.problems
        if problems:
            raise RigFaultError(f"no run can be started: {'; '.join(problems)}")

    def _require_active(self, run_id: str) -> Run:
        run = self.active
        if run is None or run.record.id != run_id:
            raise RunStateError(f"run '{run_id}' is not under way")
        return run

    def _new_record(self, owner: str, note: str) -> RunRecord:
        now = datetime.now(UTC)
        run_id = f"{now:%Y%m%d-%H%M%S}-{secrets.token_hex(3)}"
        profile = self._rig.profile
        return RunRecord(
            id=run_id,
            state=RunState.RUNNING,
            profile_name=profile.name,
            profile=ProfileDocument.of(profile).model_dump_json(),
            session=f"sessions/{run_id}",
            owner=owner,
            note=note,
            created_at=now,
            started_at=now,
        )

    def _end_of(self, token: str) -> Callable[[CalibrationRecord | None, Calibration | None], None]:
        def end(record: CalibrationRecord | None, calibration: Calibration | None) -> None:
            if record is not None and calibration is not None:
                self._activate(record, calibration)
            self._leases.release(token)

        return end


def _missing_end(record: RunRecord, sequence: int) -> Finished:
    """Return the last event of a run whose daemon was killed before it could tell it."""
    return Finished(
        run_id=record.id,
        sequence=sequence,
        time=record.ended_at or record.created_at,
        state=record.state,
        error=record.error,
        calibration_id=record.calibration_id,
    )
