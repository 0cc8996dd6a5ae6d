"""What a person looks at before a run, to see that all is as it should be."""

import asyncio
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from calib.errors import CalibError
from calib.targets import target_points
from daemon.lease import LeaseDesk
from daemon.live_detection import LiveDetection
from daemon.pose import PoseService
from daemon.procedure.manager import RunManager
from daemon.profile import Procedure
from daemon.rig import Rig
from drivers.errors import DriverError

DEEP: Final = 2
"""Bytes that a pixel takes on disk at the most."""
HALF: Final = 0.5
"""Share of the target's points that are to be in the picture."""
SPARE: Final = 200e6
"""Bytes that are to be left on the disk for everything else."""


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that was looked at; `ok` is None where it is not known, or a run sees to it itself."""

    name: str
    title: str
    ok: bool | None
    message: str


class Checklist:
    """Looks at the rig, its camera and the disk that `folder` is on; moves nothing."""

    def __init__(
        self,
        rig: Rig,
        leases: LeaseDesk,
        runs: RunManager,
        sightings: LiveDetection,
        poses: PoseService,
        folder: Path,
    ) -> None:
        self._rig = rig
        self._leases = leases
        self._runs = runs
        self._sightings = sightings
        self._poses = poses
        self._folder = folder

    async def checks(self, procedure: Procedure) -> list[Check]:
        """Return what stands for and against a run of `procedure`, in the order in which to see to it."""
        return [
            self._devices(),
            self._stop(),
            self._nobody_else(),
            self._homed(),
            *await self._seen(),
            self._settings(),
            await asyncio.to_thread(self._room_to_move, procedure),
            await asyncio.to_thread(self._room_on_disk, procedure),
        ]

    def _devices(self) -> Check:
        problems = self._rig.snapshot.problems
        message = "; ".join(problems) or "all devices answer"
        return Check("devices", "Devices answer", not problems, message)

    def _stop(self) -> Check:
        latch = self._rig.latch
        message = (
            f"stopped ({latch.reason}): acknowledge it"
            if latch.engaged
            else "no stop waits to be acknowledged"
        )
        return Check("stop", "The rig may move", not latch.engaged, message)

    def _nobody_else(self) -> Check:
        title, lease = "Nobody else moves the rig", self._leases.current
        if self._runs.active is not None:
            return Check("free", title, False, f"run '{self._runs.active.record.id}' is under way")
        if lease is not None:  # perhaps by who asks
            return Check("free", title, None, f"'{lease.owner}' has control")
        return Check("free", title, True, "nobody has control")

    def _homed(self) -> Check:
        lacking = [axis.spec.name for axis in self._rig.snapshot.axes if not axis.homed]
        if not lacking:
            return Check("homed", "Axes are homed", True, "all axes know where they are")
        names = ", ".join(f"'{name}'" for name in lacking)
        message = f"{names} will be homed first: see that nothing is in the way"
        return Check("homed", "Axes are homed", None, message)

    async def _seen(self) -> list[Check]:
        try:
            look = (await self._sightings.newest()).inspection
        except DriverError as error:
            return [Check("target", "The target is seen", False, str(error))]
        if look.detection is None:
            message = look.problem or "the target is not found in the picture"
            return [Check("target", "The target is seen", False, message)]
        count = len(target_points(self._rig.profile.target))
        seen = f"{len(look.detection.ids)} of {count} points are found"
        spoilt = [fault.message for fault in look.faults if fault.spoils]
        return [
            Check("target", "The target is seen", True, seen),
            Check(
                "picture",
                "The picture is sharp and well lit",
                not spoilt,
                "; ".join(spoilt) or "nothing spoils it",
            ),
        ]

    def _settings(self) -> Check:
        title, name = "The camera's settings are fixed", self._rig.profile.camera.spec.name
        camera = next(device for device in self._rig.snapshot.devices if device.name == name)
        message = (
            "; ".join(camera.warnings) or "exposure and focus stay as they are, as far as the driver can tell"
        )
        return Check("settings", title, not camera.warnings, message)

    def _room_to_move(self, procedure: Procedure) -> Check:
        """Tell whether the target stays in the picture, as a calibration has it; the profile has checked the limits."""
        title, planned = "The target stays in the picture", list(procedure.planned_views())
        readings = np.array([list(view.readings.values()) for view in planned])
        if self._poses.calibration_id is None:
            message = f"all {len(planned)} positions are within the axes' limits; what is seen there shows in the run"
            return Check("room", title, None, message)
        try:
            lost = self._out_of_picture(readings)
        except CalibError as error:
            return Check(
                "room", title, None, f"all {len(planned)} positions are within the axes' limits; {error}"
            )
        if lost:
            message = (
                f"by the active calibration less than half of the target is in the picture at {len(lost)} of "
                f"{len(planned)} positions ({_listed(lost)}): shorten the sweep, or start it from elsewhere"
            )
            return Check("room", title, False, message)
        message = f"by the active calibration the target is in the picture at all {len(planned)} positions"
        return Check("room", title, True, message)

    def _out_of_picture(self, readings: NDArray[np.float64]) -> list[int]:
        """Return at which of the positions (n, m), counted from 1, more than half of the target is not seen."""
        active = self._poses.active
        pixels = active.calibration.project(target_points(self._rig.profile.target), readings)
        camera = self._rig.profile.camera.spec
        inside = ((pixels >= 0) & (pixels <= np.array([camera.width, camera.height]) - 1)).all(axis=2)
        lost: list[int] = (np.flatnonzero(inside.mean(axis=1) < HALF) + 1).tolist()
        return lost

    def _room_on_disk(self, procedure: Procedure) -> Check:
        title, camera = "There is room on the disk", self._rig.profile.camera.spec
        views = sum(1 for _ in procedure.planned_views())
        needed = views * procedure.frames * camera.width * camera.height * DEEP
        try:
            free = shutil.disk_usage(self._folder).free
        except OSError as error:
            return Check(
                "disk", title, None, f"the data folder cannot be looked at: {os.strerror(error.errno or 0)}"
            )
        message = f"{free / 1e9:.3g} GB are free, and the pictures take {needed / 1e9:.2g} GB at the most"
        return Check("disk", title, free > needed + SPARE, message)


def _listed(positions: Sequence[int], most: int = 5) -> str:
    shown = ", ".join(str(position) for position in positions[:most])
    return shown if len(positions) <= most else f"{shown}, …"
