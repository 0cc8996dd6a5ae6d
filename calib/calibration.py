"""The calibration: what is known of an active camera, as an immutable document.

Axes and points are in the world frame at all readings 0, in metres; `scale` turns a reading into radians or
metres. The screws, mounts and lenses are the result; D-H and base are views of them.
"""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from calib.chain import Chain
from calib.corrections import Corrections, checked_sides
from calib.dh import link_transform
from calib.dh_covariance import DhCovariance, dh_covariance
from calib.documents import Document, Number, Positive, read_json, validate, write_json
from calib.errors import CalibError
from calib.pose_covariance import CorrectedReadings, PoseTerms, TwistCovariance, pose_terms, twist_covariance
from calib.projection import lens_by_number, projected, projection_covariances
from calib.session import Intrinsics, JointKind, RigidRows, StoredTarget, WorldOrigin
from calib.stated_corrections import StatedCorrections
from calib.stated_quality import Quality
from calib.targets import Target, target_points

CALIBRATION_FORMAT = "activecam.calibration/1"

Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]


class JointScrew(Document):
    """A joint's axis as a screw in the world, at all readings 0."""

    name: str
    kind: JointKind
    reading_unit: str
    scale: Positive
    scale_std: Number | None = None
    axis: Triple
    point: Triple


class DhStd(Document):
    """The standard deviations of a D-H row's entries, each with all others free."""

    a_prev: Number
    alpha_prev: Number
    d_offset: Number
    theta_offset: Number
    scale: Number


class DhLink(Document):
    """A row of the modified D-H model (eq 9 to 11): lengths in metres, angles in radians."""

    a_prev: Number
    alpha_prev: Number
    d_offset: Number
    theta_offset: Number
    scale: Number
    std: DhStd | None = None


class CalibratedCamera(Document):
    """A camera on the chain: where it sits on its link, and its lens; null where it is not known."""

    name: str
    link: str | None
    link_from_camera: RigidRows | None
    intrinsics: Intrinsics | None
    world_from_camera: RigidRows | None = None
    """The pose at all readings 0, from which poses are computed: it stays exact where D-H frames run off."""


class Covariance(Document):
    """Covariance of this document's own numbers, named by their dotted paths."""

    parameters: list[str]
    matrix: list[list[Number]]

    @model_validator(mode="after")
    def _square(self) -> Self:
        count = len(self.parameters)
        if len(self.matrix) != count or any(len(row) != count for row in self.matrix):
            raise ValueError(f"matrix: must have {count} rows and columns, one for each parameter")
        return self


class Calibration(Document):
    """A calibrated active camera."""

    format: Literal["activecam.calibration/1"]
    method: Literal["ml", "closed_form"]
    joints: list[JointScrew]
    dh: list[DhLink]
    world_from_base: RigidRows
    cameras: Annotated[list[CalibratedCamera], Field(min_length=1)]
    corrections: StatedCorrections = Field(default_factory=StatedCorrections)
    range: list[Annotated[list[Number], Field(min_length=2, max_length=2)]]
    covariance: Covariance | None = None
    quality: Quality
    target: StoredTarget | None = None
    origin: WorldOrigin | None = None
    held: dict[str, Number | Triple] = Field(default_factory=dict)
    """What was not found but held, by the name of the parameter, and at what."""

    @model_validator(mode="after")
    def _sizes_agree(self) -> Self:
        for field in ("dh", "range"):
            if len(getattr(self, field)) != len(self.joints):
                raise ValueError(
                    f"{field}: has {len(getattr(self, field))} rows for {len(self.joints)} joints"
                )
        names = [joint.name for joint in self.joints]
        for index, camera in enumerate(self.cameras):
            if camera.link is not None and camera.link not in names:
                raise ValueError(f"cameras[{index}].link: '{camera.link}' is not a joint of this calibration")
        for name in self.corrections.joint_names():
            if name not in names:
                raise ValueError(f"corrections: '{name}' is not a joint of this calibration")
        return self

    @cached_property
    def chain(self) -> Chain:
        """The joints as screws in the world."""
        return Chain.of(
            [joint.kind for joint in self.joints],
            [joint.axis for joint in self.joints],
            [joint.point for joint in self.joints],
            [joint.scale for joint in self.joints],
        )

    def camera_index(self, name: str | None) -> int:
        """Return the place of the camera `name`, of the first for None; raises CalibError for no such one."""
        names = [camera.name for camera in self.cameras]
        if name is None:
            return 0
        if name not in names:
            raise CalibError(f"there is no camera '{name}' in this calibration; it has {', '.join(names)}")
        return names.index(name)

    def world_from_camera(
        self, readings: ArrayLike, camera: str | None = None, approached: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Return the camera's poses (n, 4, 4) at `readings` (n, m), or (4, 4) for one vector (m,).

        `approached` (n, m) or (m,) says from which side each joint came to its reading: +1 from below, -1 from above.
        Where it is 0, or not given, a joint with backlash is taken to stand in the middle of its play. Raises
        ReadingsError for readings of the wrong length, CalibError for a camera that has no mount.
        """
        index = self.camera_index(camera)
        mount = self._mounts[index]
        if mount is None:
            raise CalibError(
                f"the lens of camera '{self.cameras[index].name}' is calibrated, but not where it sits; "
                "solve a session whose views have joint readings"
            )
        values = self.chain.checked(readings)
        corrections = self._joint_corrections
        if corrections.models or approached is not None:
            rows = np.atleast_2d(values)
            values = corrections.applied(rows, checked_sides(approached, rows)).reshape(values.shape)
        return self.chain.poses(values, self._links[index], mount)

    def pose_covariance(
        self,
        readings: ArrayLike,
        camera: str | None = None,
        approached: ArrayLike | None = None,
        reading_std: ArrayLike | None = None,
    ) -> NDArray[np.float64] | None:
        """Return the poses' covariances (n, 6, 6) at `readings` (n, m), or (6, 6) for one vector; None if unknown.

        Rotation (rad) then position (m), in the camera's frame. Of a joint with backlash whose side of approach is not
        known, half its play to either side is added; `reading_std` (n, m) or (m,), 0 by default, is how unsure the
        readings themselves are, in their own units. Raises as `world_from_camera` does.
        """
        index = self.camera_index(camera)
        known, mount = self._twist_covariances[index], self._mounts[index]
        if known is None or mount is None:
            return None
        values = self.chain.checked(readings)
        covariances = self._pose_terms(index, mount, values, approached, reading_std).covariances(known)
        return covariances if values.ndim == 2 else np.asarray(covariances[0])

    def project(
        self,
        points: ArrayLike,
        readings: ArrayLike,
        camera: str | None = None,
        approached: ArrayLike | None = None,
    ) -> NDArray[np.float64]:
        """Return where `points` (p, 3) in the world (m) are seen: pixels (n, p, 2) at `readings` (n, m).

        (p, 2) for one vector of readings. NaN for a point that the lens cannot see; a pixel may lie beyond the picture.
        Raises as `world_from_camera` does, and CalibError for a camera without a lens.
        """
        lens = self._lens(self.camera_index(camera))
        world = np.asarray(points, dtype=float).reshape(-1, 3)
        return projected(world, self.world_from_camera(readings, camera, approached), lens)

    def projection_covariance(
        self,
        points: ArrayLike,
        readings: ArrayLike,
        camera: str | None = None,
        approached: ArrayLike | None = None,
    ) -> NDArray[np.float64] | None:
        """Return the covariances (n, p, 2, 2) of the pixels of `project` in px^2, or (p, 2, 2); None if unknown.

        They tell how sure the calibration is of chain, mount and lens, and not how noisy a detector is.
        """
        index = self.camera_index(camera)
        lens, known, mount = self._lens(index), self._twist_covariances[index], self._mounts[index]
        if known is None or mount is None or self.covariance is None:
            return None
        values, world = self.chain.checked(readings), np.asarray(points, dtype=float).reshape(-1, 3)
        poses = self.world_from_camera(np.atleast_2d(values), camera, approached)
        terms = self._pose_terms(index, mount, values, approached)
        by_number = lens_by_number(index, lens, self.covariance.parameters)
        covariances = projection_covariances(world, poses, lens, terms, known, by_number)
        return covariances if values.ndim == 2 else np.asarray(covariances[0])

    def dh_covariance(self) -> DhCovariance | None:
        """Return the covariance of the D-H rows and of the base; None where unknown."""
        if self.covariance is None:
            return None
        base, stated = np.array(self.world_from_base), self.covariance
        return dh_covariance(self.chain, base, stated.parameters, np.array(stated.matrix))

    def points_of(self, target: Target) -> NDArray[np.float64]:
        """Return where a target's points are in the world (t, 3), out of its plane where this plate's warp is known."""
        points, warp = target_points(target), self.corrections.target_warp
        if (
            warp is not None
            and self.target is not None
            and np.array_equal(points, target_points(self.target))
        ):
            points[:, 2] += warp.bulge(points)
        return points

    def base_from_world(self) -> NDArray[np.float64]:
        """Return the base frame's inverse (4, 4)."""
        return np.linalg.inv(np.array(self.world_from_base))

    def out_of_range(self, readings: Sequence[float]) -> list[str]:
        """Return the names of the joints whose reading lies beyond those seen in the fit."""
        return [
            joint.name
            for joint, (low, high), reading in zip(self.joints, self.range, readings, strict=True)
            if not low <= reading <= high
        ]

    def _lens(self, index: int) -> Intrinsics:
        lens = self.cameras[index].intrinsics
        if lens is None:
            raise CalibError(
                f"the lens of camera '{self.cameras[index].name}' is not known: its views carried poses, not points"
            )
        return lens

    def _pose_terms(
        self,
        index: int,
        mount: NDArray[np.float64],
        values: NDArray[np.float64],
        approached: ArrayLike | None,
        reading_std: ArrayLike | None = None,
    ) -> PoseTerms:
        rows, corrections = np.atleast_2d(values), self._joint_corrections
        sides = checked_sides(approached, rows)
        std = corrections.unknown_side_std(sides)
        corrected = CorrectedReadings(
            corrections.applied(rows, sides),
            corrections.regressors(rows, sides),
            std if reading_std is None else np.hypot(std, np.asarray(reading_std, dtype=float)),
        )
        return pose_terms(self.chain, mount, self._links[index], corrected)

    @cached_property
    def _joint_corrections(self) -> Corrections:
        return self.corrections.joint_corrections([joint.name for joint in self.joints])

    @cached_property
    def _links(self) -> list[int]:
        names = [joint.name for joint in self.joints]
        return [
            len(names) if camera.link is None else names.index(camera.link) + 1 for camera in self.cameras
        ]

    @cached_property
    def _mounts(self) -> list[NDArray[np.float64] | None]:
        """Each camera's pose at all readings 0 (4, 4)."""
        return [
            self._mount_on_link(camera, link)
            if camera.world_from_camera is None
            else np.array(camera.world_from_camera, dtype=float)
            for camera, link in zip(self.cameras, self._links, strict=True)
        ]

    @cached_property
    def _twist_covariances(self) -> list[TwistCovariance | None]:
        """Each camera's chain covariance, None where nothing is known of it."""
        stated = self.covariance
        if stated is None:
            return [None] * len(self.cameras)
        matrix, paths = np.array(stated.matrix), self._joint_corrections.paths()
        return [
            None
            if mount is None
            else twist_covariance(self.chain, mount, index, link, paths, stated.parameters, matrix)
            for index, (mount, link) in enumerate(zip(self._mounts, self._links, strict=True))
        ]

    def _mount_on_link(self, camera: CalibratedCamera, link: int) -> NDArray[np.float64] | None:
        if camera.link_from_camera is None:
            return None
        frame = np.array(self.world_from_base)
        for joint, row in zip(self.joints[:link], self.dh, strict=False):
            frame = frame @ link_transform(
                joint.kind, row.a_prev, row.alpha_prev, row.d_offset, row.theta_offset, row.scale, 0.0
            )
        return np.asarray(frame @ np.array(camera.link_from_camera))


def load_calibration(path: str | Path) -> Calibration:
    """Read a calibration file; raises FormatError with a sentence that names the field."""
    path = Path(path)
    return validate(Calibration, read_json(path), str(path), CALIBRATION_FORMAT)


def save_calibration(calibration: Calibration, path: str | Path) -> None:
    """Write a calibration durably, so that a crash leaves either the new file or the old one."""
    write_json(Path(path), calibration)
