"""The camera's pose, now and at given readings: from the rig's snapshot and the active calibration alone."""

import logging
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic_core import to_json

from calib import Calibration
from daemon.errors import NotCalibratedError, StaleReadingError
from daemon.pose.active import ActiveCalibration, Poses
from daemon.rig import Rig, RigSnapshot
from drivers.errors import DeviceLostError, NotHomedError

logger = logging.getLogger(__name__)

Array = NDArray[np.float64]


class PoseService:
    """Answers without touching hardware. Transforms are 4 x 4 in metres, quaternions x, y, z, w."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._active: ActiveCalibration | None = None
        self._written: dict[str | None, tuple[RigSnapshot, bytes]] = {}
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
        self._written.clear()
        logger.info("poses are computed from calibration '%s'", prepared.id)

    def now(self, camera: str | None = None) -> bytes:
        """Return the pose at the latest readings, as the JSON of the API's `Pose`.

        Raises NotCalibratedError, UnknownCameraError, NotHomedError, DeviceLostError and StaleReadingError.
        """
        active = self.active
        snapshot = self._rig.snapshot
        age = self._require_fresh(snapshot)
        written = self._written.get(camera)
        if written is None or written[0] is not snapshot:
            written = snapshot, to_json(self._answer(active, snapshot, camera))[:-1]
            self._written[camera] = written
        return b'%s,"age_s":%.6f}' % (written[1], age)

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
        return to_json(
            {
                "calibration_id": active.id,
                "camera": active.camera(camera),
                "poses": [_pose_fields(poses, index) for index in range(len(poses.readings))],
            }
        )

    def _answer(
        self, active: ActiveCalibration, snapshot: RigSnapshot, camera: str | None
    ) -> Mapping[str, Any]:
        readings = np.array([snapshot.readings], dtype=float)
        poses = active.poses(readings, camera, np.array([snapshot.approached]))
        assert snapshot.timestamp is not None
        return {
            "timestamp": self._rig.utc.at(snapshot.timestamp)
            .isoformat(timespec="microseconds")
            .replace("+00:00", "Z"),
            **_pose_fields(poses, 0),
            "moving": snapshot.moving,
            "calibration_id": active.id,
            "camera": active.camera(camera),
        }

    def _require_fresh(self, snapshot: RigSnapshot) -> float:
        """Return the readings' age (s); raises unless every one of them can be believed."""
        for axis in snapshot.axes:
            if axis.lost is not None:
                raise DeviceLostError(f"axis '{axis.spec.name}' cannot be read: {axis.lost}")
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


def _pose_fields(poses: Poses, index: int) -> dict[str, Any]:
    world_from_camera = poses.world_from_camera[index]
    return {
        "readings": poses.readings[index].tolist(),
        "approached": poses.approached[index].tolist(),
        "world_from_camera": world_from_camera.tolist(),
        "base_from_camera": poses.base_from_camera[index].tolist(),
        "position": world_from_camera[:3, 3].tolist(),
        "quaternion": poses.quaternion[index].tolist(),
        "covariance": None if poses.covariance is None else poses.covariance[index].tolist(),
        "out_of_range": poses.out_of_range[index],
    }
