"""How far a view is from what a calibration predicts of it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.calibration import Calibration
from calib.disks import centroid_offsets
from calib.errors import CalibError
from calib.lens import project_points
from calib.observations import Observation
from calib.pose_from_view import pose_from_view
from calib.session import Intrinsics, Session
from calib.targets import Target, disk_diameter, target_points, target_symmetries
from calib.transforms import inverse, pose_error

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ViewResidual:
    """One view against the calibration.

    `pixels` (n, 2) are predicted less measured points (px), None where the view has none. `predicted` and
    `measured` are world_from_camera (4, 4), `measured` from this view alone, None where nobody asked.
    """

    view: int
    pixels: Array | None
    predicted: Array
    measured: Array | None

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


def view_residual(
    calibration: Calibration, session: Session, observation: Observation, measure_pose: bool = False
) -> ViewResidual:
    """Compare a view with the prediction of `calibration`, reading a symmetric target the way nearer to it.

    With `measure_pose` the view's own pose is estimated from its points. A camera that the calibration knows
    no place for is predicted where this very view puts it. Raises CalibError.
    """
    view, target = session.views[observation.view], session.target
    name = session.cameras[observation.camera].name
    if observation.pose is not None:
        measured = observation.pose
        predicted = calibration.world_from_camera(view.readings, name) if calibration.joints else measured
        return ViewResidual(observation.view, None, predicted, measured if calibration.joints else None)
    lens = calibration.cameras[calibration.camera_index(name)].intrinsics
    if lens is None:
        raise CalibError(f"the calibration knows no lens of camera '{name}': its pictures cannot be judged")
    if not calibration.joints:
        predicted = measured_pose(observation, target, lens)
        pixels = predicted_pixels(observation, target, lens, predicted) - observation.pixels
        return ViewResidual(observation.view, pixels, predicted, None)
    predicted = calibration.world_from_camera(view.readings, name)
    observation, pixels = read_as_predicted(observation, target, lens, predicted)
    return ViewResidual(
        observation.view,
        pixels,
        predicted,
        measured_pose(observation, target, lens) if measure_pose else None,
    )


def predicted_pixels(observation: Observation, target: Target, lens: Intrinsics, pose: Array) -> Array:
    """Return where a camera at `pose` (4, 4) has the observation's points measured (n, 2), in px."""
    world, camera_from_world = target_points(target)[observation.ids], inverse(pose)
    pixels = project_points(world @ camera_from_world[:3, :3].T + camera_from_world[:3, 3], lens)
    diameter = disk_diameter(target)
    if observation.disk and diameter is not None:
        pixels = pixels + centroid_offsets(world, camera_from_world, diameter, lens)
    return pixels


def measured_pose(observation: Observation, target: Target, lens: Intrinsics) -> Array:
    """Return the camera's pose (4, 4) by this view alone."""
    world = target_points(target)[observation.ids]
    pose = pose_from_view(world, observation.pixels, lens)
    diameter = disk_diameter(target)
    if observation.disk and diameter is not None:
        offsets = centroid_offsets(world, inverse(pose), diameter, lens)
        pose = pose_from_view(world, observation.pixels - offsets, lens)
    return pose


def read_as_predicted(
    observation: Observation, target: Target, lens: Intrinsics, predicted: Array
) -> tuple[Observation, Array]:
    """Return the observation read the way round nearer to a camera at `predicted` (4, 4), and its misfits (n, 2)."""
    ways = [observation, *(observation.turned(turn) for turn in target_symmetries(target))]
    misfits = [predicted_pixels(way, target, lens, predicted) - way.pixels for way in ways]
    sizes = [float(np.nan_to_num(np.abs(misfit), nan=1e9).sum()) for misfit in misfits]
    best = int(np.argmin(sizes))
    return ways[best], misfits[best]


def root_mean_square(residuals: Sequence[ViewResidual]) -> float | None:
    """Return the rms over the points of these views in px, None where they have none."""
    errors = np.concatenate([residual.errors for residual in residuals]) if residuals else np.zeros(0)
    return float(np.sqrt((errors**2).mean())) if len(errors) else None
