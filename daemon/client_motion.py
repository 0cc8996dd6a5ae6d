"""The motions that clients start: each ends with the lease under which it began."""

import asyncio
import logging
from collections.abc import Callable, Collection, Coroutine
from typing import Any

from daemon.errors import DaemonError
from daemon.lease import Lease, LeaseDesk
from daemon.operation.log_fields import log_fields
from daemon.rig import Permit, Rig
from drivers.errors import AxisBusyError, DriverError, MotionStoppedError

logger = logging.getLogger(__name__)

Motion = Callable[[Permit], Coroutine[Any, Any, None]]
"""What is to move, as long as it is permitted."""


class ClientMotions:
    """Homing, moves and jogs under way, by the lease's token, with the axes of each."""

    def __init__(self, rig: Rig, leases: LeaseDesk) -> None:
        self._rig = rig
        self._leases = leases
        self._under_way: dict[str, dict[asyncio.Task[None], Collection[str]]] = {}
        self._beginning: set[str] = set()
        """Axes of motions whose first steps are still to be taken."""
        leases.on_end(self._stop)

    async def begin(self, lease: Lease, axes: Collection[str], motion: Motion) -> asyncio.Task[None]:
        """Begin a motion of `axes` that is cancelled, and so stopped, when `lease` ends; nothing is sent after that.

        Returns when one of `axes` moves or the motion is over; raises what kept it from beginning, and
        LeaseEndedError or LeaseHeldError where the lease is over already.
        """

        def permit() -> None:
            self._leases.require(lease.token)

        permit()
        self._require_none_beginning(axes)
        with log_fields(axis=" ".join(axes)):
            task = asyncio.create_task(motion(permit))
            task.add_done_callback(lambda done: self._finished(lease.token, done))
        self._under_way.setdefault(lease.token, {})[task] = axes
        self._beginning.update(axes)
        try:
            await self._begun(task, axes)
        finally:
            self._beginning.difference_update(axes)
        return task

    async def ended(self, motion: asyncio.Task[None]) -> None:
        """Return when the motion has reached its target; raises what ended it before."""
        await asyncio.wait([motion])
        if motion.cancelled():
            raise MotionStoppedError("the motion was stopped before its target, because its lease ended")
        motion.result()

    async def stopped(self, lease: Lease) -> None:
        """Return when whatever began under `lease`, which has ended, is over."""
        await asyncio.gather(*self._under_way.get(lease.token, ()), return_exceptions=True)

    async def _begun(self, motion: asyncio.Task[None], axes: Collection[str]) -> None:
        while not motion.done() and not any(self._rig.axis(name).moving for name in axes):
            changed = asyncio.ensure_future(self._rig.changed.wait())
            await asyncio.wait({motion, changed}, return_when=asyncio.FIRST_COMPLETED)
            changed.cancel()
        if motion.done():
            await self.ended(motion)

    async def close(self) -> None:
        """Cancel what is under way, and return when it has ended."""
        tasks = [task for tasks in self._under_way.values() for task in tasks]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _require_none_beginning(self, axes: Collection[str]) -> None:
        for name in self._beginning.intersection(axes):
            raise AxisBusyError(f"axis '{name}' is moving: wait for it or stop it before the next motion")

    def _stop(self, lease: Lease) -> None:
        for task, axes in self._under_way.get(lease.token, {}).items():
            task.cancel()
            # A cancellation takes turns of the loop to come through, in which a command would be sent.
            self._rig.call_off(axes)

    def _finished(self, token: str, task: asyncio.Task[None]) -> None:
        tasks = self._under_way[token]
        del tasks[task]
        if not tasks:
            del self._under_way[token]
        if task.cancelled() or (error := task.exception()) is None:
            return
        # Nobody may be waiting for it; GET /rig keeps the sentence with the axis.
        if isinstance(error, DriverError | DaemonError):
            logger.warning("a motion ended before its target: %s", error)
        else:
            logger.error("a motion failed", exc_info=error)
