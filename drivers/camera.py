"""The contract of a camera: frames with a sequence number and the time at which their exposure began."""

from dataclasses import dataclass
from typing import Any, NoReturn, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8 | np.uint16] | NDArray[Any]


@dataclass(frozen=True, slots=True)
class CameraSpec:
    """What the profile says of a camera."""

    name: str
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture. Pixel (0, 0) of `image` is the centre of its top-left pixel."""

    image: Image
    """(height, width) grey or (height, width, 3) BGR, 8 or 16 bits."""
    sequence: int
    """Grows with each frame of the source; a gap means that frames were dropped."""
    timestamp: float
    """When the exposure began, on the rig's clock (s)."""
    exposure: float
    """How long it lasted (s)."""


@runtime_checkable
class CameraSource(Protocol):
    """A camera that delivers frames. Nothing is opened before `open`."""

    @property
    def spec(self) -> CameraSpec:
        """What the profile says of this camera."""
        ...

    async def open(self) -> None:
        """Connect and start the stream. Raises DeviceLostError."""
        ...

    async def frame(self, after: float | None = None) -> Frame:
        """Return the newest frame whose exposure began at or after `after` (rig's clock, s), waiting for it.

        Without `after`, the newest frame there is. The same frame may be returned to several callers.
        Raises DeviceLostError when the camera is gone, DeviceTimeoutError when no such frame comes in time.
        """
        ...

    async def close(self) -> None:
        """Stop the stream and let the device go."""
        ...


@runtime_checkable
class Watchful(Protocol):
    """A camera that notices by itself when it is lost. Of others it shows when the next frame is asked for."""

    async def watch(self) -> NoReturn:
        """Wait until the camera is lost, and raise DeviceLostError."""
        ...
