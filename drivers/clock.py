"""The clock that a rig's devices share: one time base for positions, frames and waiting."""

import asyncio
import time
from typing import Protocol


class Clock(Protocol):
    """Seconds that only go forward, and a way to wait for them to pass."""

    def now(self) -> float:
        """Return the present time (s), comparable to every timestamp of the same rig."""
        ...

    async def sleep(self, seconds: float) -> None:
        """Return after `seconds` of this clock have passed."""
        ...


class SystemClock:
    """The machine's monotonic clock, as real devices use it."""

    def now(self) -> float:
        """Return CLOCK_MONOTONIC (s)."""
        return time.monotonic()

    async def sleep(self, seconds: float) -> None:
        """Wait in real time."""
        await asyncio.sleep(seconds)


class ScaledClock:
    """A clock that runs `scale` times faster than life, for simulated rigs."""

    def __init__(self, scale: float) -> None:
        if not scale > 0:
            raise ValueError(f"a clock's scale must be positive, not {scale}")
        self.scale = scale
        self._origin = time.monotonic()

    def now(self) -> float:
        """Return simulated seconds since this clock was made."""
        return (time.monotonic() - self._origin) * self.scale

    async def sleep(self, seconds: float) -> None:
        """Wait until `seconds` of simulated time have passed."""
        await asyncio.sleep(seconds / self.scale)
