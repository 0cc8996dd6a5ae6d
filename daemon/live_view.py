"""The live picture with what is seen in it, made once for all who look, at a pace that leaves time for the rest."""

import asyncio
from dataclasses import dataclass
from typing import Final

from daemon.live_detection import LiveDetection, Sighting
from daemon.live_picture import JpegPicture, LivePicture
from daemon.rig import Rig

PERIOD: Final = 1 / 15
"""Seconds between two pictures at least."""


@dataclass(frozen=True, slots=True)
class Look:
    """A picture, what is seen in it if anybody has asked, and when it was made (the event loop's clock, s)."""

    picture: JpegPicture
    sighting: Sighting | None
    made_at: float


class LiveView:
    """The newest look at what the camera sees."""

    def __init__(self, rig: Rig, pictures: LivePicture, sightings: LiveDetection) -> None:
        self._rig = rig
        self._pictures = pictures
        self._sightings = sightings
        self._newest: Look | None = None
        self._looking = asyncio.Lock()

    async def after(self, sequence: int | None, *, detect: bool) -> Look:
        """Return a look at another frame than that of number `sequence`, as soon as there is one.

        Whoever asks while somebody else looks gets what that one sees. Raises DeviceLostError, DeviceTimeoutError.
        """
        while True:
            async with self._looking:
                look = await self._now(sequence, detect=detect)
            if look.picture.sequence != sequence:
                return look
            await asyncio.sleep(PERIOD)  # the camera is slower than that

    async def _now(self, sequence: int | None, *, detect: bool) -> Look:
        loop, newest = asyncio.get_running_loop(), self._newest
        if newest is not None:
            age = loop.time() - newest.made_at
            has_all = newest.sighting is not None or not detect
            if age < PERIOD and has_all and newest.picture.sequence != sequence:
                return newest
            await asyncio.sleep(PERIOD - age)
        sighting = await self._sightings.newest() if detect else None
        frame = await self._rig.frame() if sighting is None else sighting.frame
        picture = await self._pictures.of(frame)
        self._newest = Look(picture, sighting, loop.time())
        return self._newest
