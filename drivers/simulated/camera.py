"""The simulated camera: a free-running sensor that sees where the axes truly are during each exposure."""

import asyncio
import math
from typing import ClassVar, Self

import numpy as np

from drivers.camera import CameraSpec, Frame
from drivers.clock import Clock
from drivers.driver import DriverContext
from drivers.errors import DeviceLostError, DeviceTimeoutError, OptionsError
from drivers.options import DriverOptions
from drivers.quantities import PositiveDuration, written
from drivers.simulated.exposure import Exposure
from drivers.simulated.faults import CameraFault
from drivers.simulated.world import SimulatedWorld

_POLL = 0.02
"""Seconds between two looks at whether the camera is still there."""


class SimulatedCameraOptions(DriverOptions):
    """Keys of a camera with `driver = "simulated"`; its lens and pictures are in `[simulation.camera]`."""

    timeout: PositiveDuration = written("2 s")
    """How long a frame may be overdue."""
    lateness: PositiveDuration = written("1 s")
    """How late the fault "late" delivers a frame."""
    fault: CameraFault | None = None


class SimulatedCamera:
    """Frames begin on a grid of the clock's time, one each 1/frame_rate, and carry the grid's number.

    Its faults are injected by `inject` and undone by `repair`.
    """

    Options: ClassVar[type[SimulatedCameraOptions]] = SimulatedCameraOptions

    def __init__(
        self, spec: CameraSpec, options: SimulatedCameraOptions, world: SimulatedWorld, clock: Clock
    ) -> None:
        self._spec = spec
        self._options = options
        self._clock = clock
        self._exposure = Exposure(world, spec.width, spec.height)
        self._seed = world.options.seed
        picture = world.options.camera.picture
        self._period, self._duration = 1.0 / picture.frame_rate, picture.exposure
        self._fault = options.fault
        self._frozen_at: int | None = None
        self._first: int | None = None
        """Number of the first frame since the camera was opened; None while it is closed."""
        self._latest: Frame | None = None
        self._rendering = asyncio.Lock()

    @classmethod
    def create(cls, spec: CameraSpec, options: SimulatedCameraOptions, context: DriverContext) -> Self:
        """Make a camera that is not open yet; raises OptionsError where there is no simulated world."""
        if context.world is None:
            raise OptionsError(
                "the driver 'simulated' needs a world: add a [simulation] table to the profile"
            )
        return cls(spec, options, context.world, context.clock)

    @property
    def spec(self) -> CameraSpec:
        """What the profile says of this camera."""
        return self._spec

    async def open(self) -> None:
        """Start the stream. Raises DeviceLostError while unplugged, OptionsError for its lens."""
        if self._fault == "lost":
            raise self._gone()
        await asyncio.to_thread(self._exposure.prepare)
        self._first = self._number(self._clock.now())
        self._latest = None
        if self._fault == "frozen":
            self._frozen_at = self._first

    async def close(self) -> None:
        """Stop the stream."""
        self._first = None

    async def frame(self, after: float | None = None) -> Frame:
        """Return the newest frame begun at or after `after`; see `drivers.camera.CameraSource`."""
        number = self._wanted(after)
        due = self._begins(number) + self._duration
        overdue = due + self._options.timeout
        if self._fault == "late":
            due += self._options.lateness
        if self._frozen_at is not None and number > self._frozen_at:
            due = math.inf
        while (now := self._clock.now()) < due:
            if now >= overdue:
                raise DeviceTimeoutError(
                    f"camera '{self._spec.name}' delivered no frame for {self._options.timeout:g} s: "
                    "check that it still streams"
                )
            await self._clock.sleep(min(due - now, _POLL))
            self._require_stream()
        return await self._deliver(number)

    def inject(self, fault: CameraFault) -> None:
        """Let the camera go wrong from now on."""
        self._fault = fault
        if fault == "frozen":
            self._frozen_at = self._newest()
        if fault == "lost":
            self._first = None

    def repair(self) -> None:
        """Undo the fault; a camera that was lost has to be opened again."""
        self._fault = None
        self._frozen_at = None

    async def _deliver(self, number: int) -> Frame:
        async with self._rendering:
            if self._latest is None or self._latest.sequence < number:
                begins = self._begins(number)
                # The axes' past is read here: the rendering thread never touches the world's state.
                poses = self._exposure.poses(begins, self._duration)
                noise = np.random.default_rng([self._seed, number])
                image = await asyncio.to_thread(self._exposure.picture, poses, noise)
                self._latest = Frame(image, number, begins, self._duration)
            return self._latest

    def _wanted(self, after: float | None) -> int:
        """Return the number of the newest frame there is, or of the first one still to come that fits."""
        first = self._require_stream()
        newest = self._newest()
        if self._frozen_at is not None:
            newest = min(newest, self._frozen_at)
        earliest = first if after is None else max(first, self._number(after))
        return max(newest, earliest)

    def _newest(self) -> int:
        """Return the number of the latest frame whose exposure is over."""
        late = self._options.lateness if self._fault == "late" else 0.0
        return self._number(self._clock.now() - self._duration - late) - 1

    def _number(self, t: float) -> int:
        """Return the number of the first frame that begins at `t` or later."""
        number = math.ceil(t / self._period)
        return number if self._begins(number) >= t else number + 1

    def _begins(self, number: int) -> float:
        return number * self._period

    def _require_stream(self) -> int:
        if self._fault == "lost":
            raise self._gone()
        if self._first is None:
            raise DeviceLostError(f"camera '{self._spec.name}' is not open: open it first")
        return self._first

    def _gone(self) -> DeviceLostError:
        return DeviceLostError(f"camera '{self._spec.name}' has gone: plug it in and open it again")
