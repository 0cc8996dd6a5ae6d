"""How far a view is from what a calibration predicts of it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calib.calibration import Calibration
from calib.disks import centroid_offsets
from calib.errors import CalibError
from calib.lens import project_points
from calib.likelihood.blocks import disk_offsets
from calib.likelihood.measurements import point_views
from calib.observations import Observation
from calib.pose_from_view import pose_from_view
from calib.pose_sensor import without_aspect
from calib.session import Intrinsics, Session
from calib.targets import Target, disk_diameter, target_points, target_symmetries
from calib.transforms import inverse, pose_error

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ViewResidual:
    """One view against the calibration.

    `pixels` (n, 2) are predicted less measured points (px), `ids` (n,) say which and `places` (n, 2) where they were
    measured; None and empty where the view has none. `predicted` and `measured` are world_from_camera (4, 4),
    `measured` from this view alone, None where nobody asked.
    """

    view: int
    pixels: Array | None
    predicted: Array
    measured: Array | None
    ids: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    places: Array = field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def errors(self) -> Array:
        """Euclidean errors of the points (n,) in px; empty where the view has none."""
        return np.zeros(0) if self.pixels is None else np.linalg.norm(self.pixels, axis=1)

    @property
    def position(self) -> float | None:
        """How far (m) the target lies from where it is predicted in the camera's frame.

        The target is what the camera measures: its place in the camera's frame is known better than the camera's in
        the target's, which has every error of rotation times the distance.
        """
        if self.measured is None:
            return None
        return float(np.linalg.norm(inverse(self.predicted)[:3, 3] - inverse(self.measured)[:3, 3]))

    @property
    def rotation(self) -> float | None:
        """The angle (rad) between the predicted and the measured pose."""
        if self.measured is None:
            return None
        return float(pose_error(self.predicted[None], self.measured[None])[1][0])


def view_residuals(
    calibration: Calibration,
    session: Session,
    observations: Sequence[Observation],
    measure_pose: bool = False,
) -> list[ViewResidual]:
    """Compare each view with the prediction of `calibration`, reading a symmetric target the way nearer to it.

    With `measure_pose` each view's own pose is estimated from its points. A camera that the calibration knows
    no place for is predicted where this very view puts it. Raises CalibError.
    """
    found: dict[int, ViewResidual] = {}
    for index, camera in enumerate(session.cameras):
        own = [observation for observation in observations if observation.camera == index]
        given = [observation for observation in own if observation.pose is not None]
        seen = [observation for observation in own if observation.pose is None]
        residuals = _of_poses(calibration, session, camera.name, given)
        if seen:
            residuals += _of_points(calibration, session, camera.name, seen, measure_pose)
        found |= {residual.view: residual for residual in residuals}
    return [found[observation.view] for observation in observations]


def _of_poses(
    calibration: Calibration, session: Session, camera: str, given: Sequence[Observation]
) -> list[ViewResidual]:
    """Return the residuals of views whose poses another system gave; without joints nothing predicts them."""
    residuals = []
    for observation in given:
        assert observation.pose is not None
        predicted, measured = observation.pose, None
        if calibration.joints:
            view = session.views[observation.view]
            predicted = calibration.world_from_camera(view.readings, camera, view.approached)
            measured = without_aspect(observation.pose, calibration.corrections.aspect_of(camera))
        residuals.append(ViewResidual(observation.view, None, predicted, measured))
    return residuals


def _of_points(
    calibration: Calibration, session: Session, camera: str, seen: Sequence[Observation], measure_pose: bool
) -> list[ViewResidual]:
    """Return the residuals of views of one camera, one or more, in which points are seen."""
    target, points = session.target, calibration.points_of(session.target)
    lens = calibration.cameras[calibration.camera_index(camera)].intrinsics
    if lens is None:
        raise CalibError(f"the calibration knows no lens of camera '{camera}': its pictures cannot be judged")
    if calibration.joints:
        views = [observation.view for observation in seen]
        predicted = calibration.world_from_camera(session.readings()[views], camera, session.sides()[views])
        seen = read_as_predicted(seen, target, lens, predicted)
    else:
        predicted = np.array([measured_pose(observation, target, points, lens) for observation in seen])
    pixels = misfits(seen, target, points, lens, predicted)
    return [
        ViewResidual(
            observation.view,
            pixels[row],
            predicted[row],
            measured_pose(observation, target, points, lens) if measure_pose and calibration.joints else None,
            observation.ids,
            observation.pixels,
        )
        for row, observation in enumerate(seen)
    ]


def misfits(
    observations: Sequence[Observation], target: Target, points: Array, lens: Intrinsics, poses: Array
) -> list[Array]:
    """Return by how much a camera at `poses` (n, 4, 4) has each view's points (q, 2) elsewhere than measured, in px.

    `points` (t, 3) are where the target's are in the world (m).
    """
    seen = point_views(observations, points)
    pixels = _projected(seen.world, poses, lens) + disk_offsets(seen, poses, lens, disk_diameter(target))
    away = pixels - seen.pixels
    return [away[row, : len(observation.ids)] for row, observation in enumerate(observations)]


def measured_pose(observation: Observation, target: Target, points: Array, lens: Intrinsics) -> Array:
    """Return the camera's pose (4, 4) by this view alone; `points` (t, 3) are where the target's are (m)."""
    world = points[observation.ids]
    pose = pose_from_view(world, observation.pixels, lens)
    diameter = disk_diameter(target)
    if observation.disk and diameter is not None:
        offsets = centroid_offsets(world, inverse(pose), diameter, lens)
        pose = pose_from_view(world, observation.pixels - offsets, lens)
    return pose


def read_as_predicted(
    observations: Sequence[Observation], target: Target, lens: Intrinsics, predicted: Array
) -> list[Observation]:
    """Return the views, each read the way round nearer to a camera at `predicted` (n, 4, 4)."""
    symmetries = target_symmetries(target)
    if not symmetries:
        return list(observations)
    points = target_points(target)
    seen = point_views(observations, points)
    sizes = []
    for label in [np.arange(len(points)), *(np.argsort(turn.permutation) for turn in symmetries)]:
        away = np.abs(_projected(points[label[seen.ids]], predicted, lens) - seen.pixels).sum(axis=-1)
        sizes.append((np.nan_to_num(away, nan=1e9) * seen.present).sum(axis=1))
    ways = np.argmin(sizes, axis=0)
    return [
        observation.turned(symmetries[way - 1]) if way else observation
        for observation, way in zip(observations, ways.tolist(), strict=True)
    ]


def _projected(world: Array, poses: Array, lens: Intrinsics) -> Array:
    """Return where cameras at `poses` (n, 4, 4) see their points `world` (n, q, 3): pixels (n, q, 2)."""
    camera_from_world = inverse(poses)
    points = world @ np.swapaxes(camera_from_world[:, :3, :3], 1, 2) + camera_from_world[:, None, :3, 3]
    return project_points(points, lens)
