"""The owner of a camera: connects it, hands out its frames, and notices when it is gone."""

import asyncio
from collections.abc import Callable
from typing import Any

from daemon.rig.device_owner import DeviceOwner
from drivers.camera import CameraSource, Frame, Watchful
from drivers.errors import DeviceLostError, DeviceTimeoutError, DriverError


class CameraOwner(DeviceOwner):
    """One camera. Any number of tasks may wait for frames."""

    def __init__(
        self, name: str, camera: CameraSource, frame_timeout: float, publish: Callable[[], None]
    ) -> None:
        """`frame_timeout` (s of life): how long a frame may take to come."""
        super().__init__(name, "camera", camera, publish)
        self._camera = camera
        self._frame_timeout = frame_timeout
        self._gone: asyncio.Future[None] | None = None

    async def frame(self, after: float | None = None) -> Frame:
        """Return the newest frame exposed at or after `after` (rig's clock, s); see `CameraSource.frame`.

        Raises DeviceLostError while the camera is away, DeviceTimeoutError when no such frame comes in time, and
        DriverError for a frame from before, which might show the axes elsewhere.
        """
        if self.lost is not None or self._gone is None:
            raise DeviceLostError(self.lost or f"camera '{self.name}' is not connected")
        gone = self._gone
        try:
            async with asyncio.timeout(self._frame_timeout):
                frame = await self._camera.frame(after)
        except DeviceLostError as error:
            if not gone.done():
                gone.set_exception(error)
            raise
        except DeviceTimeoutError:
            raise
        except TimeoutError:
            raise DeviceTimeoutError(
                f"camera '{self.name}' gave no frame within {self._frame_timeout:g} s: "
                "check its connection and its exposure time"
            ) from None
        if after is not None and frame.timestamp < after:
            raise DriverError(
                f"camera '{self.name}' gave a frame {after - frame.timestamp:.3g} s older than was asked for, which "
                "might show the axes elsewhere: its driver is wrong, as its contract suite will show"
            )
        return frame

    async def _open(self) -> None:
        await self._camera.open()
        self._gone = asyncio.get_running_loop().create_future()

    async def _serve(self) -> None:
        assert self._gone is not None
        self._publish()
        if not isinstance(self._camera, Watchful):
            await self._gone
            return
        watch = asyncio.create_task(self._camera.watch())
        waited: list[asyncio.Future[Any]] = [self._gone, watch]
        try:
            await asyncio.wait(waited, return_when=asyncio.FIRST_COMPLETED)
            next(one for one in waited if one.done()).result()
        finally:
            watch.cancel()
            await asyncio.gather(watch, return_exceptions=True)

    async def _close(self) -> None:
        if self._gone is not None:
            self._gone.cancel()
            self._gone = None
        await self._camera.close()
