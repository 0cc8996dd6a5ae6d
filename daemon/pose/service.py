"""The camera's pose, now, at a past time and at given readings: from what has been read and the active calibration."""

import asyncio
import logging
from collections.abc import Callable, Sequence
from datetime import datetime
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib import Calibration
from daemon.errors import NotCalibratedError, StaleReadingError
from daemon.pose.active import ActiveCalibration, Poses
from daemon.pose.answers import fields, past_fields, written, written_list
from daemon.rig import PastReadings, Rig, RigSnapshot
from daemon.rig.utc import rfc3339
from daemon.rig.wording import because
from drivers.errors import DeviceLostError, NotHomedError

logger = logging.getLogger(__name__)

Array = NDArray[np.float64]


class PoseService:
    """Answers without touching hardware. Transforms are 4 x 4 in metres, quaternions x, y, z, w.

    `given` is called, from any thread, with the number of poses of each answer.
    """

    def __init__(self, rig: Rig, given: Callable[[int], None] = lambda _: None) -> None:
        self._rig = rig
        self._given = given
        self._active: ActiveCalibration | None = None
        self._latest: dict[str | None, tuple[RigSnapshot, bytes]] = {}
        """For each camera, the answer to the latest snapshot but for its age, which goes on changing."""

    @property
    def calibration_id(self) -> str | None:
        """The id of the active calibration, if any."""
        return None if self._active is None else self._active.id

    @property
    def active(self) -> ActiveCalibration:
        """The active calibration; raises NotCalibratedError."""
        if self._active is None:
            raise NotCalibratedError(
                "nothing is calibrated: start a run with POST /api/v1/runs, or activate a calibration"
            )
        return self._active

    def prepare(self, calibration_id: str, calibration: Calibration) -> ActiveCalibration:
        """Return what `activate` takes; raises CalibrationMismatchError for another rig's calibration."""
        return ActiveCalibration.of(calibration_id, calibration, list(self._rig.specs))

    def activate(self, prepared: ActiveCalibration) -> None:
        """Answer from this calibration from now on."""
        self._active = prepared
        self._latest.clear()
        logger.info("poses are computed from calibration '%s'", prepared.id)

    def now(self, camera: str | None = None) -> bytes:
        """Return the pose at the latest readings, as the JSON of the API's `Pose`.

        Raises NotCalibratedError, UnknownCameraError, NotHomedError, DeviceLostError and StaleReadingError.
        """
        active = self.active
        snapshot = self._rig.snapshot
        age = self._require_fresh(snapshot)
        latest = self._latest.get(camera)
        if latest is None or latest[0] is not snapshot:
            latest = snapshot, written(self._answer(active, snapshot, camera))[:-1]
            self._latest[camera] = latest
        self._given(1)
        return b'%s,"age_s":%.6f}' % (latest[1], age)

    def readings_now(self) -> tuple[Array, Array]:
        """Return the latest readings (m,), and the sides they were approached from (m,); raises as `now` does."""
        snapshot = self._rig.snapshot
        self._require_fresh(snapshot)
        return np.array(snapshot.readings, dtype=float), np.array(snapshot.approached)

    def at(
        self, readings: ArrayLike, camera: str | None = None, approached: ArrayLike | None = None
    ) -> bytes:
        """Return the poses at `readings` (n, m), as the JSON of the API's `PosesAtReadings`.

        Each was `approached` from a side (n, m), none known by default. Raises NotCalibratedError, UnknownCameraError,
        ReadingsError.
        """
        active = self.active
        poses = active.poses(np.asarray(readings, dtype=float), camera, approached)
        self._given(len(poses.readings))
        return written_list(_common(active, camera), len(poses.readings), partial(fields, poses))

    async def past(self, time: datetime, camera: str | None = None) -> bytes:
        """Return the pose at a past `time`, as the JSON of the API's `PoseAtTime`.

        Raises NotCalibratedError, UnknownCameraError, TimeNotCoveredError, DeviceLostError, StaleReadingError.
        """
        active, past = self.active, await self._rig.past_readings([time])
        (pose,) = past_fields(_poses_at(active, past, camera), past, [time])
        self._given(1)
        return written(pose | _common(active, camera))

    async def past_list(self, times: Sequence[datetime], camera: str | None = None) -> bytes:
        """Return the poses at past `times`, as the JSON of the API's `PosesAtTimes`; raises as `past` does."""
        active, past = self.active, await self._rig.past_readings(times)

        def write() -> bytes:
            poses = _poses_at(active, past, camera)
            self._given(len(times))
            return written_list(
                _common(active, camera), len(times), lambda some: past_fields(poses, past, times, some)
            )

        return await asyncio.to_thread(write)

    def _answer(self, active: ActiveCalibration, snapshot: RigSnapshot, camera: str | None) -> dict[str, Any]:
        readings = np.array([snapshot.readings], dtype=float)
        (pose,) = fields(active.poses(readings, camera, np.array([snapshot.approached])))
        assert snapshot.timestamp is not None
        return {
            "timestamp": rfc3339(self._rig.utc.at(snapshot.timestamp)),
            **pose,
            "moving": snapshot.moving,
            **_common(active, camera),
        }

    def _require_fresh(self, snapshot: RigSnapshot) -> float:
        """Return the readings' age (s); raises unless every one of them can be believed."""
        for axis in snapshot.axes:
            if axis.lost is not None:
                raise DeviceLostError(because(f"axis '{axis.spec.name}'", "cannot be read", axis.lost))
        age, allowed = self._rig.age(snapshot), self._rig.profile.procedure.max_reading_age
        if age is None or age > allowed:
            what = "there is no reading yet" if age is None else f"the latest reading is {age:.3g} s old"
            raise StaleReadingError(
                f"{what}, and the profile allows {allowed:g} s: check that the axes answer"
            )
        for axis in snapshot.axes:
            if not axis.homed or axis.position is None:
                raise NotHomedError(
                    f"axis '{axis.spec.name}' is not homed: home it to know where the camera is"
                )
        return age


def _poses_at(active: ActiveCalibration, past: PastReadings, camera: str | None) -> Poses:
    # A reading that may be anywhere within its bounds has the standard deviation of a uniform distribution.
    return active.poses(past.values, camera, past.approached, past.bounds / np.sqrt(3))


def _common(active: ActiveCalibration, camera: str | None) -> dict[str, Any]:
    return {"calibration_id": active.id, "camera": active.camera(camera)}
