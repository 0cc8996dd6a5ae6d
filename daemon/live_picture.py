"""The camera's newest frame as JPEG, encoded once for all who look."""

import asyncio
from dataclasses import dataclass

import cv2
import numpy as np

from calib.errors import ImageError
from daemon.rig import Rig
from drivers.camera import Frame, Image


@dataclass(frozen=True, slots=True)
class JpegPicture:
    """An encoded frame and its number."""

    sequence: int
    data: bytes


class LivePicture:
    """The newest frame of a rig's camera."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._encoded: tuple[Frame, JpegPicture] | None = None
        self._encoding = asyncio.Lock()

    async def newest(self) -> JpegPicture:
        """Return the newest frame; raises DeviceLostError, DeviceTimeoutError."""
        frame = await self._rig.frame()
        async with self._encoding:
            if self._encoded is None or self._encoded[0] is not frame:
                data = await asyncio.to_thread(_encode, frame.image)
                self._encoded = frame, JpegPicture(frame.sequence, data)
            return self._encoded[1]


def _encode(image: Image) -> bytes:
    # JPEG holds 8 bits: of 16, the upper ones are what a person can see.
    shown = (image >> 8).astype(np.uint8) if image.dtype == np.uint16 else image
    done, data = cv2.imencode(".jpg", shown)
    if not done:
        raise ImageError("a frame could not be encoded as JPEG")
    return data.tobytes()
