"""The camera's newest frame as JPEG, encoded once for all who look."""

import asyncio
from dataclasses import dataclass

from daemon.jpeg import encoded
from daemon.rig import Rig
from drivers.camera import Frame


@dataclass(frozen=True, slots=True)
class JpegPicture:
    """An encoded frame, its number, and its size (width, height) in pixels."""

    sequence: int
    size: tuple[int, int]
    data: bytes


class LivePicture:
    """The newest frame of a rig's camera."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._encoded: tuple[Frame, JpegPicture] | None = None
        self._encoding = asyncio.Lock()

    async def newest(self) -> JpegPicture:
        """Return the newest frame; raises DeviceLostError, DeviceTimeoutError."""
        return await self.of(await self._rig.frame())

    async def of(self, frame: Frame) -> JpegPicture:
        """Return a frame, encoded only if it is another one than the last."""
        async with self._encoding:
            if self._encoded is None or self._encoded[0] is not frame:
                data = await asyncio.to_thread(encoded, frame.image)
                height, width = frame.image.shape[:2]
                self._encoded = frame, JpegPicture(frame.sequence, (width, height), data)
            return self._encoded[1]
