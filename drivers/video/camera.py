"""A video camera as activecam wants it, whatever it reads from."""

import asyncio
import time
from collections.abc import Sequence
from itertools import count
from typing import Final, NoReturn

from drivers.camera import CameraSpec, Frame
from drivers.cancellation import finish
from drivers.clock import Clock, ScaledClock
from drivers.errors import DeviceLostError, OptionsError
from drivers.video.grabber import Grabber
from drivers.video.source import Source

_WATCH: Final = 0.25
"""Seconds between two looks at whether the camera is still there."""


class VideoCamera:
    """The frames of one source; see `drivers.camera.CameraSource`. Sequence numbers go on when it is reopened."""

    def __init__(self, spec: CameraSpec, source: Source, clock: Clock, timeout: float) -> None:
        """`timeout` (s): how long a frame may be overdue. Raises OptionsError for a clock that outruns life."""
        if isinstance(clock, ScaledClock) and clock.scale != 1.0:
            raise OptionsError(
                f"camera '{spec.name}' is real and takes its time: give [simulation] time_scale = 1.0"
            )
        self._spec = spec
        self._source = source
        self._clock = clock
        self._timeout = timeout
        self._numbers = count()
        self._grabber: Grabber | None = None

    @property
    def spec(self) -> CameraSpec:
        """What the profile says of this camera."""
        return self._spec

    @property
    def warnings(self) -> Sequence[str]:
        """What is not as the profile asks or a calibration needs it; see `drivers.driver.Cautious`."""
        return () if self._grabber is None else self._grabber.warnings

    async def open(self) -> None:
        """Start the stream and return with its first frame. Raises DriverError."""
        await self.close()
        offset = self._clock.now() - time.monotonic()
        name = self._spec.name
        grabber = Grabber(name, self._source, self._timeout, self._numbers, lambda t: t + offset)
        try:
            await grabber.start()
        except BaseException:
            await finish(grabber.stop())
            raise
        self._grabber = grabber

    async def frame(self, after: float | None = None) -> Frame:
        """Return the newest frame begun at or after `after`; see `drivers.camera.CameraSource`."""
        while True:
            grabber = self._require_open()
            grabber.require_alive()
            newest = grabber.newest
            if newest is not None and (after is None or newest.timestamp >= after):
                return newest
            await grabber.news()

    async def watch(self) -> NoReturn:
        """Wait until the camera is lost; see `drivers.camera.Watchful`."""
        while True:
            self._require_open().require_alive()
            await asyncio.sleep(_WATCH)

    async def close(self) -> None:
        """Stop the stream and let the device go."""
        grabber, self._grabber = self._grabber, None
        if grabber is not None:
            await finish(grabber.stop())

    def _require_open(self) -> Grabber:
        if self._grabber is None:
            raise DeviceLostError(f"camera '{self._spec.name}' is not open: open it first")
        return self._grabber
