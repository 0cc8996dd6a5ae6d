"""What is known of runs: of the latest, which may be under way, and from the store of those before it."""

import asyncio
from collections.abc import AsyncIterator, Sequence

from daemon.procedure.event_log import past_events
from daemon.procedure.events import RunEvent
from daemon.procedure.run import Run
from daemon.store import RunRecord, Store


class RunBook:
    """The runs of a rig, to be read."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._latest: Run | None = None

    @property
    def active(self) -> Run | None:
        """The run under way, if any."""
        latest = self._latest
        return None if latest is None or latest.record.state.over else latest

    @property
    def latest(self) -> Run | None:
        """The run under way, or the last one since the daemon began."""
        return self._latest

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

    async def told(self, run_id: str) -> Sequence[RunEvent]:
        """Return a run's events so far; raises UnknownRunError."""
        if self._latest is not None and self._latest.record.id == run_id:
            return self._latest.log.events
        record = await self._store.run(run_id)
        return await asyncio.to_thread(past_events, record, self._store.session_folder(record))

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
        for event in await self.told(run_id):
            if event.sequence > after:
                yield event
