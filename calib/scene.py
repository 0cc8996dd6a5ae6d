"""The rig in 3-D at given readings: what a person recognises it by, and how surely each of it is known.

Everything is in the world, in metres. Joints and frames are drawn by the scaled readings alone: corrections of
imperfect joints are too small to be seen, and only the cameras have them. numpy alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.calibration import CalibratedCamera, Calibration
from calib.dh import link_transform
from calib.lens import pixel_rays
from calib.session import JointKind
from calib.targets import target_points

Array = NDArray[np.float64]

FRUSTUM = 0.3
"""How deep a camera's frustum is drawn, of its distance to the target."""
DEEP = 0.2
"""And where there is no target (m)."""


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """How surely a point is known: one standard deviation `radii` (3,) along the columns of `axes` (3, 3)."""

    centre: Array
    axes: Array
    radii: Array

    @classmethod
    def of(cls, centre: Array, covariance: Array) -> Self:
        """Return the ellipsoid of a covariance (3, 3)."""
        values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
        return cls(centre, vectors, np.sqrt(values.clip(0)))


@dataclass(frozen=True, eq=False)
class SceneJoint:
    """A joint as a screw: its `axis` (3,), and the `point` (3,) of it that is nearest to the first camera.

    `frame` (4, 4) is its link's, of the D-H model. A straight joint's axis lies nowhere: it is drawn through the first
    camera's place at readings 0, as carried along.
    """

    name: str
    kind: JointKind
    axis: Array
    point: Array
    frame: Array
    sure: Ellipsoid | None


@dataclass(frozen=True, eq=False)
class SceneCamera:
    """A camera's `pose` (4, 4), and where the corners of its picture (4, 3) are drawn, from the top left clockwise."""

    name: str
    pose: Array
    corners: Array | None
    sure: Ellipsoid | None


@dataclass(frozen=True, eq=False)
class Scene:
    """The rig: `base` (4, 4), joints, cameras, and the target's `points` (t, 3) within their `outline` (4, 3)."""

    base: Array
    joints: list[SceneJoint]
    cameras: list[SceneCamera]
    points: Array
    outline: Array


def scene(calibration: Calibration, readings: Sequence[float], approached: ArrayLike | None = None) -> Scene:
    """Return what stands where at `readings` (m,); raises ReadingsError for a wrong number of them.

    The standard deviations of joints are those at readings 0, carried along.
    """
    values = calibration.chain.checked(readings)
    target = calibration.target
    points = np.zeros((0, 3)) if target is None else calibration.points_of(target)
    outline = np.zeros((0, 3)) if target is None else _outline(target_points(target))
    placed = [camera for camera in calibration.cameras if _placed(camera)]
    cameras = [_camera(calibration, camera.name, values, approached, points) for camera in placed]
    eye = cameras[0].pose[:3, 3] if cameras else points.mean(axis=0) if len(points) else np.zeros(3)
    base = np.array(calibration.world_from_base, dtype=float)
    return Scene(base, _joints(calibration, values, base, eye), cameras, points, outline)


def _placed(camera: CalibratedCamera) -> bool:
    return camera.link_from_camera is not None or camera.world_from_camera is not None


def _outline(points: Array) -> Array:
    """Return the corners (4, 3) of a flat target's points."""
    if len(points) == 0:
        return np.zeros((0, 3))
    (x0, y0), (x1, y1) = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    return np.array([[x0, y0, 0], [x1, y0, 0], [x1, y1, 0], [x0, y1, 0]])


def _joints(calibration: Calibration, values: Array, base: Array, eye: Array) -> list[SceneJoint]:
    chain, frame, joints = calibration.chain, base, []
    for index, (joint, row) in enumerate(zip(calibration.joints, calibration.dh, strict=True)):
        before, moved = chain.displacement(values, index), chain.displacement(values, index + 1)
        frame = frame @ link_transform(
            joint.kind, row.a_prev, row.alpha_prev, row.d_offset, row.theta_offset, row.scale, values[index]
        )
        axis = before[:3, :3] @ chain.axes[index]
        point = moved[:3, :3] @ chain.points[index] + moved[:3, 3]
        sure = None
        if chain.revolute[index]:
            along = float((eye - point) @ axis)
            point = point + along * axis
            sure = _sure_of_axis(calibration, index, before, point)
        joints.append(SceneJoint(joint.name, joint.kind, axis, point, frame, sure))
    return joints


def _sure_of_axis(calibration: Calibration, index: int, before: Array, point: Array) -> Ellipsoid | None:
    """Return how surely the point of a joint's axis is known that `before` (4, 4) has carried to `point` (3,)."""
    stated = calibration.covariance
    names = [f"joints.{index}.{part}.{i}" for part in ("point", "axis") for i in range(3)]
    if stated is None or not set(names) <= set(stated.parameters):
        return None
    places = [stated.parameters.index(name) for name in names]
    covariance = np.array(stated.matrix)[np.ix_(places, places)]
    there = before[:3, :3].T @ (point - before[:3, 3])
    along = float((there - calibration.chain.points[index]) @ calibration.chain.axes[index])
    by_numbers = before[:3, :3] @ np.hstack([np.eye(3), along * np.eye(3)])
    return Ellipsoid.of(point, by_numbers @ covariance @ by_numbers.T)


def _camera(
    calibration: Calibration, name: str, values: Array, approached: ArrayLike | None, points: Array
) -> SceneCamera:
    pose = calibration.world_from_camera(values, name, approached)
    known = calibration.pose_covariance(values, name, approached)
    turn, eye = pose[:3, :3], pose[:3, 3]
    sure = None if known is None else Ellipsoid.of(eye, turn @ known[3:, 3:] @ turn.T)
    lens = calibration.cameras[calibration.camera_index(name)].intrinsics
    corners = None
    if lens is not None and lens.width is not None and lens.height is not None:
        depth = DEEP if len(points) == 0 else FRUSTUM * float(np.linalg.norm(points.mean(axis=0) - eye))
        right, bottom = lens.width - 0.5, lens.height - 0.5
        rays = pixel_rays(np.array([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]]), lens)
        corners = eye + depth * (rays / rays[:, 2:]) @ turn.T
        if not np.isfinite(corners).all():  # a lens model may not reach into its corners
            corners = None
    return SceneCamera(name, pose, corners, sure)
