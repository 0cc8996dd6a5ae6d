"""The calibration that poses are computed from, with what can be prepared once."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib import Calibration
from calib.errors import ReadingsError
from calib.session import Intrinsics
from daemon.errors import CalibrationMismatchError, LensUnknownError, UnknownCameraError
from daemon.pose.quaternion import quaternions

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """Poses at n readings: transforms (n, 4, 4), quaternions (n, 4; x, y, z, w), joints beyond the range.

    `approached` (n, m) are the sides from which the joints came: 1 from below, -1 from above, 0 where not known.

    `covariance` (n, 6, 6) is of rotation (rad), then position (m), in the camera's frame; None where it is not known.
    """

    readings: Array
    approached: Array
    world_from_camera: Array
    base_from_camera: Array
    quaternion: Array
    covariance: Array | None
    out_of_range: list[list[str]]


@dataclass(frozen=True, slots=True, eq=False)
class ActiveCalibration:
    """A calibration of this rig's chain, under its id in the store."""

    id: str
    calibration: Calibration
    base_from_world: Array
    low: Array
    high: Array
    """The smallest and largest readings (m,) of the fit."""

    @classmethod
    def of(cls, calibration_id: str, calibration: Calibration, axes: list[str]) -> Self:
        """Prepare `calibration` for a rig with `axes`; raises CalibrationMismatchError for another's."""
        joints = [joint.name for joint in calibration.joints]
        if joints != axes:
            raise CalibrationMismatchError(
                f"calibration '{calibration_id}' is of the joints {', '.join(joints)}, and this rig has "
                f"{', '.join(axes)}: activate one of this rig, or calibrate it"
            )
        low, high = np.array(calibration.range, dtype=float).reshape(-1, 2).T
        return cls(calibration_id, calibration, calibration.base_from_world(), low, high)

    def camera(self, name: str | None) -> str:
        """Return the name of a camera, the first for None; raises UnknownCameraError."""
        names = [camera.name for camera in self.calibration.cameras]
        if name is not None and name not in names:
            raise UnknownCameraError(f"there is no camera '{name}': this calibration has {', '.join(names)}")
        return names[0] if name is None else name

    def lens(self, name: str | None) -> Intrinsics:
        """Return a camera's lens; raises UnknownCameraError and LensUnknownError."""
        known = self.camera(name)
        lens = next(camera.intrinsics for camera in self.calibration.cameras if camera.name == known)
        if lens is None:
            raise LensUnknownError(f"the active calibration does not know the lens of camera '{known}'")
        return lens

    def poses(
        self,
        readings: Array,
        camera: str | None,
        approached: ArrayLike | None = None,
        reading_std: ArrayLike | None = None,
    ) -> Poses:
        """Return the camera's poses at `readings` (n, m), each `approached` from a side (n, m), none known by default.

        `reading_std` (n, m) is how unsure the readings are, in their own units; 0 by default.

        Raises UnknownCameraError, and ReadingsError for readings or sides of the wrong number, or readings too large.
        """
        name = self.camera(camera)
        sides = np.zeros(readings.shape, dtype=int) if approached is None else np.asarray(approached)
        with np.errstate(all="ignore"):
            world_from_camera = self.calibration.world_from_camera(readings, name, sides)
        if not np.all(np.isfinite(world_from_camera)):
            raise ReadingsError("readings are too large to compute a pose with: give readings of this rig")
        return Poses(
            readings,
            sides,
            world_from_camera,
            self.base_from_world @ world_from_camera,
            quaternions(world_from_camera[:, :3, :3]),
            self.calibration.pose_covariance(readings, name, sides, reading_std),
            self._out_of_range(readings),
        )

    def _out_of_range(self, readings: Array) -> list[list[str]]:
        beyond: list[list[str]] = [[] for _ in readings]
        for row, joint in np.argwhere((readings < self.low) | (readings > self.high)):
            beyond[row].append(self.calibration.joints[joint].name)
        return beyond
