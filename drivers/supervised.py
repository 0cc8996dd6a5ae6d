"""What axes of every make share: one motion at a time, watched to its confirmed end, and sent only once.

A driver derives its axis from `SupervisedAxis` and says in a few methods how its device is spoken to.
"""

import asyncio
import contextlib
import math
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Awaitable, Callable

from drivers.axis import AxisSpec, AxisState
from drivers.cancellation import finish
from drivers.clock import Clock
from drivers.errors import (
    AxisBusyError,
    DeviceFaultError,
    DeviceTimeoutError,
    DriverError,
    MotionError,
    MotionStoppedError,
)


class SupervisedAxis(ABC):
    """An `Axis` whose motions end at a standstill that the device confirms, and where they were sent.

    Axes that share a `turn` move one after the other: a motion waits until that of another axis is over.
    `poll` is the time (s) between two looks at an axis in motion.
    """

    def __init__(
        self, spec: AxisSpec, clock: Clock, *, turn: asyncio.Lock | None = None, poll: float = 0.02
    ) -> None:
        self._spec = spec
        self._clock = clock
        self._turn = asyncio.Lock() if turn is None else turn
        self._poll = poll
        self._busy = False
        self._stopped = False

    @property
    def spec(self) -> AxisSpec:
        """What the profile says of this axis."""
        return self._spec

    @abstractmethod
    async def read(self) -> AxisState:
        """Ask the device for its state; see `drivers.axis.Axis`."""

    async def home(self) -> None:
        """Find the axis's zero; see `drivers.axis.Axis`."""
        async with self._alone():
            await self._ready()
            await self._carry_out(self._begin_homing, self._home(), self._homing_time())

    async def move(self, target: float) -> None:
        """Go to `target` and stand there; see `drivers.axis.Axis`."""
        self._spec.check_target(target)
        async with self._alone():
            state = await self._ready()
            self._require_sound(state)
            start = state.require_homed(self._spec)
            time = self._spec.move_time(target - start)
            await self._carry_out(lambda: self._begin_move(target), target, time)

    async def jog(self, distance: float) -> None:
        """Move by `distance`, homed or not; see `drivers.axis.Axis`."""
        async with self._alone():
            state = await self._ready()
            self._require_sound(state)
            self._spec.check_jog(distance, state.position)
            start = await self._where()
            target = None if start is None else start + distance
            await self._carry_out(lambda: self._begin_jog(distance), target, self._spec.move_time(distance))

    async def stop(self) -> None:
        """Stop at once, and return when the device says that the axis stands.

        Raises DeviceTimeoutError where it does not come to a stand, and DeviceLostError.
        """
        self._stopped = True
        await self._halt()
        if not await self._standstill(self._clock.now() + self._spec.move_time(0.0)):
            raise DeviceTimeoutError(
                f"axis '{self._spec.name}' was told to stop and still reports motion: "
                "switch off its power, and find out why before it moves again"
            )

    @abstractmethod
    async def _begin_homing(self) -> None:
        """Tell the device to home the axis, and return when it has taken that in."""

    @abstractmethod
    async def _begin_move(self, target: float) -> None:
        """Tell the device to go to `target`, and return when it has taken that in."""

    @abstractmethod
    async def _begin_jog(self, distance: float) -> None:
        """Tell the device to move by `distance`, and return when it has taken that in."""

    @abstractmethod
    async def _halt(self) -> None:
        """Tell the device to stop, past whatever is queued or under way, without waiting for the standstill.

        A motion whose beginning is still on its way to the device must not begin after this.
        """

    @abstractmethod
    async def _stands(self) -> bool:
        """Ask the device whether the axis stands, and all that was asked of it is done.

        Raises DeviceLostError, and DeviceFaultError where it will not finish.
        """

    @abstractmethod
    async def _where(self) -> float | None:
        """Return where the device takes the axis to be, homed or not, None where it has no idea."""

    def _home(self) -> float | None:
        """Return where the axis stands once it is homed; None where only the device knows."""
        return None

    def _homing_time(self) -> float:
        """Return how long (s) homing may take: by default the whole travel at half the velocity."""
        low, high = self._spec.limits
        return 2 * self._spec.move_time(high - low)

    @contextlib.asynccontextmanager
    async def _alone(self) -> AsyncIterator[None]:
        """Take the axis for one motion. Raises AxisBusyError where another one has it."""
        if self._busy:
            raise self._is_busy()
        self._busy, self._stopped = True, False
        try:
            async with self._turn:
                yield
        finally:
            self._busy = False

    async def _ready(self) -> AxisState:
        """Return the state from which a motion begins. Raises AxisBusyError where the axis does not stand."""
        state = await self.read()
        if state.moving:
            raise self._is_busy()
        return state

    def _is_busy(self) -> AxisBusyError:
        return AxisBusyError(
            f"axis '{self._spec.name}' is moving: wait for it or stop it before the next motion"
        )

    def _require_sound(self, state: AxisState) -> None:
        if state.fault is not None:
            raise DeviceFaultError(
                f"axis '{self._spec.name}': {state.fault}: clear what caused it and home the axis"
            )

    async def _carry_out(
        self, begin: Callable[[], Awaitable[None]], target: float | None, time: float
    ) -> None:
        """Begin a motion and watch it to its end; whatever ends it early, the device is told to stop."""
        self._require_not_stopped(target)
        deadline = self._clock.now() + time
        try:
            await begin()
            arrived = await self._standstill(deadline)
        except asyncio.CancelledError:
            with contextlib.suppress(DriverError):
                await finish(self.stop())
            raise
        except DriverError:
            # A device that no longer answers may still listen.
            with contextlib.suppress(DriverError):
                await finish(self._halt())
            raise
        if not arrived:
            await finish(self.stop())
            raise DeviceTimeoutError(
                f"axis '{self._spec.name}' still reports motion {time:.1f} s after it was sent to "
                f"{self._named(target)}: it was stopped; check that it moves freely"
            )
        await self._check_arrival(target)

    async def _standstill(self, deadline: float = math.inf) -> bool:
        """Wait until the device says that the axis stands; return False where `deadline` comes first.

        What counts is what it says when it is asked after the deadline: an older answer may have waited for a program
        that was held up.
        """
        while True:
            late = self._clock.now() >= deadline
            if await self._stands():
                return True
            if late:
                return False
            await self._clock.sleep(self._poll)

    async def _check_arrival(self, target: float | None) -> None:
        position = await self._where()
        self._require_sound(await self.read())
        self._require_not_stopped(target, position)
        if position is None or target is None:
            return
        if abs(position - target) > self._spec.tolerance:
            raise MotionError(
                f"axis '{self._spec.name}' stands at {self._named(position)} and was sent to "
                f"{self._named(target)}: it is blocked or has slipped; clear the way and home it"
            )

    def _require_not_stopped(self, target: float | None, position: float | None = None) -> None:
        if self._stopped:
            stands = "" if position is None else f": it stands at {self._named(position)}"
            raise MotionStoppedError(
                f"axis '{self._spec.name}' was stopped on its way to {self._named(target)}{stands}"
            )

    def _named(self, position: float | None) -> str:
        return "its home" if position is None else f"{position:g} {self._spec.unit}"
