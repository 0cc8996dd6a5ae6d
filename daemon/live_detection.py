"""What is seen of the target in the camera's newest frame, looked for once for all who ask."""

import asyncio
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from daemon.rig import Rig
from drivers.camera import Frame

if TYPE_CHECKING:
    from calib.detection import Detection, Inspection
    from calib.targets import Target


@dataclass(frozen=True, slots=True)
class Sighting:
    """One frame, when it was exposed, and what is in it."""

    frame: Frame
    taken_at: datetime
    inspection: "Inspection"


class LiveDetection:
    """The target in the newest frame of a rig's camera, tracked from look to look."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._newest: Sighting | None = None
        self._looking = asyncio.Lock()

    async def newest(self) -> Sighting:
        """Look for the target in the newest frame; raises DeviceLostError, DeviceTimeoutError."""
        async with self._looking:
            frame = await self._rig.frame()
            if self._newest is None or self._newest.frame is not frame:
                before = None if self._newest is None else self._newest.inspection.detection
                target = self._rig.profile.target
                inspection = await asyncio.to_thread(_inspect, frame, target, before)
                self._newest = Sighting(frame, self._rig.utc.at(frame.timestamp), inspection)
            return self._newest


def _inspect(frame: Frame, target: "Target", before: "Detection | None") -> "Inspection":
    from calib.detection import inspect  # loaded here, beside the event loop, when somebody looks

    return inspect(frame.image, target, before=before)
