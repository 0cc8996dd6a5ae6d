"""The owner of a motion controller: polls its axes, starts their motions, and stops them past everything."""

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from daemon.operation.log_fields import log_fields
from daemon.rig.device_owner import DeviceOwner
from daemon.rig.snapshot import AxisSnapshot, Side
from daemon.rig.stop_latch import StopLatch
from daemon.rig.wording import because
from drivers.axis import Axis, AxisController, AxisSpec, AxisState
from drivers.cancellation import finish
from drivers.errors import AxisBusyError, DeviceLostError, DriverError, MotionStoppedError

logger = logging.getLogger(__name__)

POLL_PERIOD: Final = 0.02
"""Seconds of life between two readings of an axis."""

Action = Callable[[Axis], Awaitable[None]]
Permit = Callable[[], object]
"""Raises what forbids a motion; asked at the last moment before its command is sent."""


def freely() -> None:
    """Forbid nothing."""


@dataclass(slots=True)
class _AxisRecord:
    """What the owner remembers of one axis."""

    spec: AxisSpec
    state: AxisState | None = None
    number: int = 0
    motion: asyncio.Task[None] | None = None
    approached: Side = 0
    must_home: bool = False
    """A device that was away may have been moved or have miscounted: only homing makes it known again."""
    last_error: str | None = None


class ControllerOwner(DeviceOwner):
    """One controller and its axes. At most one motion an axis; a second one is refused, never queued."""

    def __init__(
        self,
        name: str,
        controller: AxisController,
        specs: Mapping[str, AxisSpec],
        latch: StopLatch,
        publish: Callable[[], None],
    ) -> None:
        super().__init__(name, "controller", controller, publish)
        self._controller = controller
        self._latch = latch
        self._axes = {axis: _AxisRecord(spec) for axis, spec in specs.items()}
        self._wake = asyncio.Event()

    @property
    def axes(self) -> Iterable[str]:
        """The names of the controller's axes."""
        return self._axes.keys()

    def snapshot(self, name: str) -> AxisSnapshot:
        """Return what is known of one axis."""
        record = self._axes[name]
        state = record.state
        in_motion = record.motion is not None
        if state is None:
            return AxisSnapshot(record.spec, self.name, moving=in_motion, lost=self.lost)
        return AxisSnapshot(
            record.spec,
            self.name,
            position=state.position,
            timestamp=state.timestamp,
            number=record.number,
            moving=state.moving or in_motion,
            homed=state.homed and not record.must_home,
            approached=record.approached,
            fault=state.fault,
            lost=self.lost,
            last_error=record.last_error,
        )

    def poll_soon(self) -> None:
        """Read the axes again now rather than at the next turn."""
        self._wake.set()

    def require_idle(self, name: str) -> None:
        """Raise DeviceLostError or AxisBusyError unless a motion of this axis may begin."""
        if self.lost is not None:
            raise DeviceLostError(because(f"axis '{name}'", "cannot move", self.lost))
        if self._axes[name].motion is not None:
            raise AxisBusyError(f"axis '{name}' is moving: wait for it or stop it before the next motion")

    def call_off(self, name: str) -> None:
        """Cancel an axis's motion, if there is one, at once: if its command has not been sent yet, it is not."""
        motion = self._axes[name].motion
        if motion is not None:
            motion.cancel()

    async def home(self, name: str, permit: Permit = freely) -> None:
        """Home one axis; after that its position is believed again."""
        await self.carry_out(name, lambda axis: axis.home(), permit)
        self._axes[name].must_home, self._axes[name].approached = False, 0
        self._publish()

    async def carry_out(self, name: str, action: Action, permit: Permit = freely) -> None:
        """Run one motion of one axis to its confirmed standstill.

        Cancelling stops the axis, and goes on only when it stands. Raises what the driver raises, and
        StopLatchedError, DeviceLostError, AxisBusyError and what `permit` raises before anything is sent.
        """
        self.require_idle(name)
        self._latch.require_free()
        record = self._axes[name]
        with log_fields(axis=name):
            motion = asyncio.ensure_future(self._act(name, action, permit))
        record.motion, record.last_error = motion, None
        self._publish()
        try:
            await _watch(motion)
            if motion.cancelled() and self.lost is not None:
                raise DeviceLostError(because(f"axis '{name}'", "did not reach its target", self.lost))
            if motion.cancelled():
                raise MotionStoppedError(f"axis '{name}' was stopped before the motion reached its target")
            motion.result()
        except asyncio.CancelledError:
            record.last_error = f"the motion of axis '{name}' was cancelled before its target"
            raise
        except DriverError as error:
            record.last_error = str(error)
            raise
        finally:
            record.motion = None
            self.poll_soon()
            self._publish()

    async def stop(self, names: Iterable[str]) -> dict[str, str]:
        """Stop axes at once, past every motion under way, and wait until they stand.

        Returns why an axis could not be confirmed to stand, by its name; empty when all of them do.
        """
        names = list(names)
        axes = self._controller.axes
        results = await asyncio.gather(*(axes[name].stop() for name in names), return_exceptions=True)
        motions = [motion for name in names if (motion := self._axes[name].motion) is not None]
        # A stop reaches the device before a motion that was just begun may: none is left to send its command.
        for motion in motions:
            motion.cancel()
        if motions:
            await asyncio.wait(motions)
        self.poll_soon()
        return {
            name: str(result) if isinstance(result, DriverError) else f"axis '{name}': {result!r}"
            for name, result in zip(names, results, strict=True)
            if isinstance(result, Exception)
        }

    async def _act(self, name: str, action: Action, permit: Permit) -> None:
        self._latch.require_free()  # a stop since the motion was asked for is only on its way to the device
        permit()
        record = self._axes[name]
        began, side = record.state, record.approached
        record.approached = 0
        await action(self._controller.axes[name])
        # What is asked right after a motion must not find the state from before it.
        await self._read(name)
        record.approached = _side(record.spec, side, began, record.state)

    async def _open(self) -> None:
        await self._controller.open()
        await self._poll()
        await self._still()

    async def _serve(self) -> None:
        while True:
            self._publish()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(POLL_PERIOD):
                    await self._wake.wait()
            self._wake.clear()
            with self._at_work():
                await self._poll()

    async def _still(self) -> None:
        """Stop what moves although nobody here has moved it: a daemon that was killed may have."""
        moving = [
            name for name, record in self._axes.items() if record.state is not None and record.state.moving
        ]
        for name in moving:
            logger.warning("axis '%s' was found moving, and is stopped", name)
        await asyncio.gather(*(self._controller.axes[name].stop() for name in moving))
        if moving:
            await self._poll()

    async def _poll(self) -> None:
        for name in self._axes:
            await self._read(name)

    async def _read(self, name: str) -> None:
        state = await self._controller.axes[name].read()
        record = self._axes[name]
        if record.state is None or state.timestamp >= record.state.timestamp:
            record.state, record.number = state, record.number + 1

    async def _close(self) -> None:
        motions = [record.motion for record in self._axes.values() if record.motion is not None]
        for motion in motions:
            motion.cancel()
        if motions:
            await asyncio.wait(motions)
        await self._controller.close()

    def _on_loss(self) -> None:
        for record in self._axes.values():
            record.must_home, record.approached = record.must_home or record.state is not None, 0


def _side(spec: AxisSpec, before: Side, began: AxisState | None, ended: AxisState | None) -> Side:
    """Return the side after a motion; an axis that was already there keeps the one from `before`."""
    if began is None or ended is None or began.position is None or ended.position is None:
        return 0
    travel = ended.position - began.position
    if abs(travel) <= spec.tolerance:
        return before
    return 1 if travel > 0 else -1


async def _watch(motion: asyncio.Task[None]) -> None:
    """Wait for the end of `motion`; a cancellation stops it first, and goes on when it has ended."""
    try:
        await asyncio.wait([motion])
    except asyncio.CancelledError:
        motion.cancel()
        await finish(_end(motion))
        raise


async def _end(motion: asyncio.Task[None]) -> None:
    await asyncio.wait([motion])
    if not motion.cancelled():
        motion.exception()  # asked for, so that asyncio does not report it as never retrieved
