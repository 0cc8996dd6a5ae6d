"""How far a view is from what a calibration predicts of it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.calibration import Calibration
from calib.disks import centroid_offsets
from calib.lens import project_points
from calib.observations import Observation
from calib.pose_from_view import pose_from_view
from calib.session import Intrinsics, Session
from calib.targets import AsymmetricCircleGrid, CircleGrid, Target, target_points, target_symmetries
from calib.transforms import inverse, pose_error

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ViewResidual:
    """One view against the calibration.

    `pixels` (n, 2) are predicted less measured points (px), None where the view has none. `predicted` and
    `measured` are world_from_camera (4, 4), `measured` from this view alone. `position` is how far (m) the
    target lies from where it is predicted in the camera's frame, `rotation` the angle (rad) between the two
    poses.
    """

    view: int
    pixels: Array | None
    predicted: Array
    measured: Array
    position: float
    rotation: float

    @property
    def errors(self) -> Array:
        """Euclidean errors of the points (n,) in px; empty where the view has none."""
        return np.zeros(0) if self.pixels is None else np.linalg.norm(self.pixels, axis=1)


def view_residual(calibration: Calibration, session: Session, observation: Observation) -> ViewResidual:
    """Compare a view with the prediction of `calibration`, reading a symmetric target the way nearer to it.

    A camera that the calibration knows no place for is predicted where this very view puts it. Raises
    CalibError.
    """
    view, target = session.views[observation.view], session.target
    name = session.cameras[observation.camera].name
    camera = calibration.cameras[calibration.camera_index(name)]
    lens = camera.intrinsics
    placed = bool(calibration.joints)
    if observation.pose is None and lens is not None:
        if not placed:
            measured = measured_pose(observation, target, lens)
            predicted = measured
        else:
            predicted = calibration.world_from_camera(view.readings, name)
            observation = _read_as_predicted(observation, target, lens, predicted)
            measured = measured_pose(observation, target, lens)
        pixels: Array | None = predicted_pixels(observation, target, lens, predicted) - observation.pixels
    else:
        assert observation.pose is not None
        measured, pixels = observation.pose, None
        predicted = calibration.world_from_camera(view.readings, name) if placed else measured
    # The target is what the camera measures: its place in the camera's frame is known better than the
    # camera's in the target's, which has every error of rotation times the distance.
    position, rotation = pose_error(inverse(predicted)[None], inverse(measured)[None])
    return ViewResidual(observation.view, pixels, predicted, measured, float(position[0]), float(rotation[0]))


def predicted_pixels(observation: Observation, target: Target, lens: Intrinsics, pose: Array) -> Array:
    """Return where a camera at `pose` (4, 4) has the observation's points measured (n, 2), in px."""
    world, camera_from_world = target_points(target)[observation.ids], inverse(pose)
    pixels = project_points(world @ camera_from_world[:3, :3].T + camera_from_world[:3, 3], lens)
    if observation.disk and isinstance(target, CircleGrid | AsymmetricCircleGrid):
        pixels = pixels + centroid_offsets(world, camera_from_world, target.disk_diameter, lens)
    return pixels


def measured_pose(observation: Observation, target: Target, lens: Intrinsics) -> Array:
    """Return the camera's pose (4, 4) by this view alone."""
    world = target_points(target)[observation.ids]
    pose = pose_from_view(world, observation.pixels, lens)
    if observation.disk and isinstance(target, CircleGrid | AsymmetricCircleGrid):
        offsets = centroid_offsets(world, inverse(pose), target.disk_diameter, lens)
        pose = pose_from_view(world, observation.pixels - offsets, lens)
    return pose


def _read_as_predicted(
    observation: Observation, target: Target, lens: Intrinsics, predicted: Array
) -> Observation:
    readings = [observation, *(observation.turned(turn) for turn in target_symmetries(target))]
    if len(readings) == 1:
        return observation
    misses = [
        np.abs(predicted_pixels(seen, target, lens, predicted) - seen.pixels).sum() for seen in readings
    ]
    return readings[int(np.argmin(np.nan_to_num(misses, nan=np.inf)))]


def root_mean_square(residuals: Sequence[ViewResidual]) -> float | None:
    """Return the rms over the points of these views in px, None where they have none."""
    errors = np.concatenate([residual.errors for residual in residuals]) if residuals else np.zeros(0)
    return float(np.sqrt((errors**2).mean())) if len(errors) else None
