"""One view: go there, stand, settle, take frames exposed after that, and find the target in them."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.detection import (
    Averaged,
    Fault,
    Prediction,
    detect_in_all,
    faults,
    picture_health,
    track_in_all,
)
from calib.errors import DetectionError
from calib.targets import Target
from daemon.rig import Rig, RigSnapshot, Side
from drivers.camera import Frame
from drivers.errors import DeviceFaultError, MotionError


@dataclass(frozen=True, slots=True)
class Taken:
    """Frames of one view, and the readings (chain order) at which they were taken."""

    frames: list[Frame]
    readings: list[float]
    approached: list[Side]
    taken_at: datetime
    settled: float
    """Seconds of the rig's clock between the confirmed standstill and the first exposure."""

    def view_fields(self) -> dict[str, Any]:
        """Return what the view keeps of it beside the pictures."""
        return {
            "readings": self.readings,
            "approached": self.approached,
            "time": self.taken_at.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            "settle": {"settled_s": self.settled, "exposure_s": self.frames[0].exposure},
        }


@dataclass(frozen=True, slots=True)
class Observation:
    """Frames in which the target was found."""

    taken: Taken
    seen: Averaged
    faults: tuple[Fault, ...]
    """What is wrong with the first frame all the same."""


class Observer:
    """Takes the views of one run with a rig that nobody else moves."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig

    async def go(self, targets: Mapping[str, float]) -> None:
        """Move axes to `targets` (reading units) and confirm by a fresh state that they stand there.

        Raises MotionError where they do not, and what `Rig.move` raises.
        """
        await self._rig.move(targets)
        standing = await self._standing()
        for name, target in targets.items():
            spec, position = self._rig.specs[name], standing.axis(name).position
            if position is None or abs(position - target) > spec.tolerance:
                where = "an unknown position" if position is None else f"{position:g} {spec.unit}"
                raise MotionError(
                    f"axis '{name}' stands at {where} and was sent to {target:g} {spec.unit}: "
                    "clear the way and home it"
                )

    async def take(self) -> Taken:
        """Wait until the rig has settled, and take the frames.

        Raises MotionError where an axis moves meanwhile, and what `Rig.frame` raises.
        """
        clock = self._rig.clock
        stood_at = (await self._standing()).timestamp
        await clock.sleep(self._rig.profile.procedure.settle)
        settled = await self._standing()
        assert stood_at is not None
        frames = await self._frames(after=clock.now())
        self._require_unmoved(settled, await self._standing())
        return Taken(
            frames=frames,
            readings=[position for position in settled.readings if position is not None],
            approached=list(settled.approached),
            taken_at=self._rig.utc.at(frames[0].timestamp),
            settled=frames[0].timestamp - stood_at,
        )

    async def _frames(self, after: float) -> list[Frame]:
        """Return as many frames as the profile asks for, one after the other."""
        frames: list[Frame] = []
        for _ in range(self._rig.profile.procedure.frames):
            frames.append(await self._rig.frame(after))
            after = math.nextafter(frames[-1].timestamp, math.inf)
        return frames

    async def _standing(self) -> RigSnapshot:
        """Return a fresh snapshot in which every axis knows where it is, and stands.

        Raises MotionError, DeviceFaultError and DeviceLostError.
        """
        snapshot = await self._rig.fresh_snapshot(self._rig.clock.now())
        for axis in snapshot.axes:
            if axis.moving:
                raise MotionError(
                    f"axis '{axis.spec.name}' moves when it should stand: find out who moves it"
                )
            if axis.fault is not None:
                raise DeviceFaultError(f"axis '{axis.spec.name}': {axis.fault}")
            if axis.position is None:
                raise MotionError(f"axis '{axis.spec.name}' no longer knows where it is: home it")
        return snapshot

    def _require_unmoved(self, before: RigSnapshot, after: RigSnapshot) -> None:
        for earlier, later in zip(before.axes, after.axes, strict=True):
            assert earlier.position is not None
            assert later.position is not None
            spec = earlier.spec
            if abs(later.position - earlier.position) > spec.tolerance:
                raise MotionError(
                    f"axis '{spec.name}' went from {earlier.position:g} to {later.position:g} {spec.unit} "
                    "while a picture was taken: it does not hold its position"
                )


def find(taken: Taken, target: Target) -> Observation:
    """Look for the target in all frames; raises DetectionError where it is found in none."""
    return _observation(taken, target, detect_in_all(_images(taken), target))


def find_where_predicted(taken: Taken, target: Target, predicted: Prediction) -> Observation:
    """Look for the target where it should be, which finds what is seen of it; raises DetectionError."""
    return _observation(taken, target, track_in_all(_images(taken), target, predicted))


def _images(taken: Taken) -> Iterator[NDArray[np.generic]]:
    return (frame.image for frame in taken.frames)


def _observation(taken: Taken, target: Target, seen: Averaged) -> Observation:
    if len(seen.detection.ids) == 0:
        raise DetectionError("no point of the target was found in the picture")
    return Observation(
        taken, seen, tuple(faults(picture_health(taken.frames[0].image, target, seen.detection)))
    )
