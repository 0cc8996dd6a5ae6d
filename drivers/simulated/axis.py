"""A simulated axis: it moves a shaft of the world as a motor controller would."""

from collections.abc import Mapping

import numpy as np

from drivers.axis import AxisSpec, AxisState
from drivers.simulated.device import Device
from drivers.simulated.faults import AxisFault, DeviceFault
from drivers.simulated.motion import rest, trapezoid
from drivers.simulated.shaft import Shaft
from drivers.supervised import SupervisedAxis


class SimulatedAxis(SupervisedAxis):
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
        super().__init__(spec, device.clock)
        self._shaft = shaft
        self._device = device
        self._home_position = home_position
        device.on_power_loss(self.lose_power)
        self._noise = np.random.default_rng(seed)
        self._planned = planned
        self._motions = 0
        self._homed = False
        self._hanging = False
        self._next_fault: AxisFault | None = None
        self._device_fault: tuple[float, DeviceFault] | None = None
        """What the motion under way brings about, and when."""

    async def read(self) -> AxisState:
        """Read the encoder. Raises DeviceLostError."""
        await self._device.answer(self._spec.name)
        now = self._clock.now()
        fault = "the controller is in alarm" if self._device.fault == "alarm" else None
        position = self._encoder(now) if self._homed else None
        return AxisState(position, now, self._moving(now), self._homed, fault)

    async def home(self) -> None:
        """Go to the home switch, at half the axis's velocity, and take that place as the home position."""
        await super().home()
        self._homed = True

    def brake(self) -> None:
        """Begin to stop, without waiting for the standstill."""
        now = self._clock.now()
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

    async def _begin_homing(self) -> None:
        self._device.clear_alarm()
        self._homed = False
        self._drive(self._home_position, self._spec.velocity / 2)

    async def _begin_move(self, target: float) -> None:
        self._drive(target, self._spec.velocity)

    async def _begin_jog(self, distance: float) -> None:
        self._drive(self._shaft.motor(self._clock.now()) + distance, self._spec.velocity)

    async def _halt(self) -> None:
        self.brake()

    async def _stands(self) -> bool:
        await self._device.answer(self._spec.name)
        now = self._clock.now()
        if self._device_fault is not None and now >= self._device_fault[0]:
            self._device.fail(self._device_fault[1])
            self._device_fault = None
            return False
        return not self._moving(now)

    async def _where(self) -> float:
        return self._count(self._shaft.motor(self._clock.now()))

    def _home(self) -> float:
        return self._home_position

    def _homing_time(self) -> float:
        return 2 * self._spec.move_time(self._home_position - self._shaft.motor(self._clock.now()))

    def _drive(self, target: float, velocity: float) -> None:
        """Begin a motion, with what was planned or injected to go wrong in it."""
        self._motions += 1
        fault = self._next_fault or self._planned.get(self._motions)
        self._next_fault = None
        now = self._clock.now()
        start = self._shaft.motor(now)
        reached = (start + target) / 2 if fault == "stall" else target
        motion = trapezoid(start, reached, now, velocity, self._spec.acceleration)
        self._hanging = fault == "hang"
        self._device_fault = None
        match fault:
            case "lost" | "mute" | "late" | "alarm":
                self._device_fault = 0.5 * (now + motion.ends), fault
        self._shaft.drive(motion)

    def _encoder(self, t: float) -> float:
        noise = self._shaft.gear.reading_noise
        return self._count(self._shaft.motor(t) + (noise * self._noise.standard_normal() if noise else 0.0))

    def _count(self, position: float) -> float:
        resolution = self._shaft.gear.encoder_resolution
        return round(position / resolution) * resolution if resolution else position

    def _moving(self, t: float) -> bool:
        return self._hanging or t < self._shaft.motion.ends
