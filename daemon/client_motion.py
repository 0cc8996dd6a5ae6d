"""The motions that clients start: each ends with the lease under which it began."""

import asyncio
import logging
from collections.abc import Collection, Coroutine
from typing import Any

from daemon.errors import DaemonError
from daemon.lease import Lease, LeaseDesk
from daemon.rig import Rig
from drivers.errors import DriverError, MotionStoppedError

logger = logging.getLogger(__name__)


class ClientMotions:
    """Homing, moves and jogs under way, by the lease's token."""

    def __init__(self, rig: Rig, leases: LeaseDesk) -> None:
        self._rig = rig
        self._under_way: dict[str, set[asyncio.Task[None]]] = {}
        leases.on_end(self._stop)

    def start(self, lease: Lease, motion: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Begin a motion that is cancelled, and so stopped, when `lease` ends."""
        task = asyncio.create_task(motion)
        self._under_way.setdefault(lease.token, set()).add(task)
        task.add_done_callback(lambda done: self._finished(lease.token, done))
        return task

    async def begun(self, motion: asyncio.Task[None], axes: Collection[str]) -> None:
        """Return when one of `axes` moves or the motion is over; raises what kept it from beginning."""
        while not motion.done() and not any(self._rig.axis(name).moving for name in axes):
            changed = asyncio.ensure_future(self._rig.changed.wait())
            await asyncio.wait({motion, changed}, return_when=asyncio.FIRST_COMPLETED)
            changed.cancel()
        if motion.done():
            await self.ended(motion)

    async def ended(self, motion: asyncio.Task[None]) -> None:
        """Return when the motion has reached its target; raises what ended it before."""
        await asyncio.wait([motion])
        if motion.cancelled():
            raise MotionStoppedError("the motion was stopped before its target, because its lease ended")
        motion.result()

    async def close(self) -> None:
        """Cancel what is under way, and return when it has ended."""
        tasks = [task for tasks in self._under_way.values() for task in tasks]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _stop(self, lease: Lease) -> None:
        for task in self._under_way.get(lease.token, ()):
            task.cancel()

    def _finished(self, token: str, task: asyncio.Task[None]) -> None:
        tasks = self._under_way[token]
        tasks.discard(task)
        if not tasks:
            del self._under_way[token]
        if task.cancelled() or (error := task.exception()) is None:
            return
        # Nobody may be waiting for it; GET /rig keeps the sentence with the axis.
        if isinstance(error, DriverError | DaemonError):
            logger.warning("a motion ended before its target: %s", error)
        else:
            logger.error("a motion failed", exc_info=error)
