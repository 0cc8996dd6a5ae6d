"""A simulated axis: it moves a shaft of the world as a motor controller would."""

import asyncio
import contextlib
import math
from collections.abc import Mapping

import numpy as np

from drivers.axis import AxisSpec, AxisState
from drivers.cancellation import finish
from drivers.errors import (
    AxisBusyError,
    DeviceTimeoutError,
    DriverError,
    MotionError,
    MotionStoppedError,
)
from drivers.simulated.device import Device
from drivers.simulated.faults import AxisFault, DeviceFault
from drivers.simulated.motion import rest, trapezoid
from drivers.simulated.shaft import Shaft

_POLL = 0.02
"""Seconds between two looks at an axis in motion, as a real driver polls."""


class SimulatedAxis:
    """One axis of a `SimulatedController`. Its position is unknown until it has been homed."""

    def __init__(
        self,
        spec: AxisSpec,
        shaft: Shaft,
        device: Device,
        *,
        home_position: float,
        seed: tuple[int, int],
        planned: Mapping[int, AxisFault | DeviceFault],
    ) -> None:
        self._spec = spec
        self._shaft = shaft
        self._device = device
        self._clock = device.clock
        self._home_position = home_position
        device.on_power_loss(self.lose_power)
        self._noise = np.random.default_rng(seed)
        self._planned = planned
        self._motions = 0
        self._homed = False
        self._busy = False
        self._stopped = False
        self._hanging = False
        self._next_fault: AxisFault | None = None

    @property
    def spec(self) -> AxisSpec:
        """What the profile says of this axis."""
        return self._spec

    async def read(self) -> AxisState:
        """Read the encoder. Raises DeviceLostError."""
        await self._device.answer(self._spec.name)
        now = self._clock.now()
        fault = "the controller is in alarm" if self._device.fault == "alarm" else None
        position = self._encoder(now) if self._homed else None
        return AxisState(position, now, self._moving(now), self._homed, fault)

    async def home(self) -> None:
        """Go to the home switch, at half the axis's velocity, and take that place as the home position."""
        await self._device.answer(self._spec.name)
        self._require_idle()
        self._device.clear_alarm()
        self._homed = False
        await self._carry_out(self._home_position, self._spec.velocity / 2)
        self._homed = True

    async def move(self, target: float) -> None:
        """Go to `target` and stand there; see `drivers.axis.Axis`."""
        self._spec.check_target(target)
        state = await self.read()
        self._device.require_no_alarm(self._spec.name)
        self._require_idle()
        state.require_homed(self._spec)
        await self._carry_out(target, self._spec.velocity)

    async def jog(self, distance: float) -> None:
        """Move by `distance`, homed or not; see `drivers.axis.Axis`."""
        state = await self.read()
        self._device.require_no_alarm(self._spec.name)
        self._require_idle()
        self._spec.check_jog(distance, state.position)
        await self._carry_out(self._shaft.motor(self._clock.now()) + distance, self._spec.velocity)

    async def stop(self) -> None:
        """Brake with the axis's acceleration and return when it stands."""
        await self._device.answer(self._spec.name)
        self.brake()
        await self._standstill()

    def brake(self) -> None:
        """Begin to stop, without waiting for the standstill."""
        now = self._clock.now()
        self._stopped = self._stopped or (self._busy and self._moving(now))
        self._hanging = False
        if now < self._shaft.motion.ends:
            self._shaft.drive(self._shaft.motion.stopped(now, self._spec.acceleration))

    def inject(self, fault: AxisFault) -> None:
        """Let the next motion go wrong."""
        self._next_fault = fault

    def lose_power(self) -> None:
        """Stand still at once, and forget where that is."""
        self._shaft.drive(rest(self._shaft.motor(self._clock.now()), self._clock.now()))
        self._homed = False
        self._hanging = False

    def _encoder(self, t: float) -> float:
        noise = self._shaft.gear.reading_noise
        return self._count(self._shaft.motor(t) + (noise * self._noise.standard_normal() if noise else 0.0))

    def _count(self, position: float) -> float:
        resolution = self._shaft.gear.encoder_resolution
        return round(position / resolution) * resolution if resolution else position

    def _moving(self, t: float) -> bool:
        return self._hanging or t < self._shaft.motion.ends

    def _require_idle(self) -> None:
        if self._busy or self._moving(self._clock.now()):
            raise AxisBusyError(
                f"axis '{self._spec.name}' is moving: wait for it or stop it before the next motion"
            )

    async def _carry_out(self, target: float, velocity: float) -> None:
        """Move to `target` and check the arrival; a cancellation goes on when the axis stands."""
        now = self._clock.now()
        self._motions += 1
        fault = self._next_fault or self._planned.get(self._motions)
        self._next_fault = None
        start = self._shaft.motor(now)
        reached = (start + target) / 2 if fault == "stall" else target
        motion = trapezoid(start, reached, now, velocity, self._spec.acceleration)
        deadline = max(motion.ends + 2.0, now + self._spec.move_time(target - start))

        self._busy, self._stopped, self._hanging = True, False, fault == "hang"
        self._shaft.drive(motion)
        try:
            match fault:
                case "lost" | "mute" | "alarm":
                    await self._standstill(0.5 * (now + motion.ends))
                    self._device.fail(fault)
            if not await self._standstill(deadline):
                self.brake()
                await self._standstill()
                raise DeviceTimeoutError(
                    f"axis '{self._spec.name}' still reports motion {deadline - now:.1f} s after it was "
                    f"sent to {target:g} {self._spec.unit}: it was stopped; check that it moves freely"
                )
        except asyncio.CancelledError:
            self.brake()
            with contextlib.suppress(DriverError):
                await finish(self._standstill())
            raise
        finally:
            self._busy = False
        self._check_arrival(target)

    async def _standstill(self, deadline: float = math.inf) -> bool:
        """Wait until the device reports that the axis stands; return False where `deadline` comes first."""
        while True:
            await self._device.answer(self._spec.name)
            now = self._clock.now()
            if not self._moving(now):
                return True
            if now >= deadline:
                return False
            await self._clock.sleep(_POLL)

    def _check_arrival(self, target: float) -> None:
        name, unit = self._spec.name, self._spec.unit
        self._device.require_no_alarm(name)
        position = self._count(self._shaft.motor(self._clock.now()))
        if self._stopped:
            raise MotionStoppedError(
                f"axis '{name}' was stopped on its way to {target:g} {unit}: it stands at {position:g} {unit}"
            )
        if abs(position - target) > self._spec.tolerance:
            raise MotionError(
                f"axis '{name}' stands at {position:g} {unit} and was sent to {target:g} {unit}: "
                "it is blocked or has slipped; clear the way and home it"
            )
