"""The closed form of a whole session: lenses, poses, the way round of a symmetric target, and the chain."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from calib.chain import Chain
from calib.closed_form import PoseViews, solve_chain
from calib.errors import UnsolvableError
from calib.lens import project_points
from calib.lens_calibration import calibrate_camera
from calib.lens_prior import lens_prior
from calib.observations import Observation
from calib.orientation import Solved, oriented
from calib.session import Camera, Intrinsics, Session, WorldOrigin
from calib.solution import Solution
from calib.targets import TargetSymmetry, disk_diameter, target_points, target_symmetries
from calib.transforms import inverse
from calib.units import nominal_scale

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CameraViews:
    """The camera's pose in every view (n, 4, 4), the lens of each camera, and how well it is known.

    `focal_std` are the focal lengths' relative standard deviations, 0 for what needed none, None for a single view's.
    """

    poses: Array
    lenses: list[Intrinsics | None]
    focal_std: list[float | None]


def camera_views(session: Session, observations: Sequence[Observation]) -> CameraViews:
    """Return the lens of each camera, as far as it is not known, and where it was in each view.

    Raises UnsolvableError that names the camera.
    """
    points, diameter = target_points(session.target), disk_diameter(session.target)
    poses = np.zeros((len(observations), 4, 4))
    lenses: list[Intrinsics | None] = []
    focal_std: list[float | None] = []
    for index, camera in enumerate(session.cameras):
        lens = camera.intrinsics
        known_to: float | None = 0.0
        own = [i for i, o in enumerate(observations) if o.camera == index and o.pose is None]
        if own:
            views = [observations[i] for i in own]
            try:
                prior = partial(lens_prior, session, index)
                found = calibrate_camera(points, views, _picture_size(camera), diameter, lens, prior)
            except UnsolvableError as error:
                raise UnsolvableError(f"camera '{camera.name}': {error}") from error
            lens, poses[own], known_to = found.lens, found.poses, found.focal_std
        lenses.append(lens)
        focal_std.append(known_to)
    for i, observation in enumerate(observations):
        if observation.pose is not None:
            poses[i] = observation.pose
    return CameraViews(poses, lenses, focal_std)


def _picture_size(camera: Camera) -> tuple[int, int]:
    if camera.width is None or camera.height is None:
        raise UnsolvableError("its width and height are not given; add them to the session's cameras")
    return camera.width, camera.height


@dataclass(frozen=True, eq=False)
class ReadOneWay:
    """Views that have a symmetric target the same way round, and the chain and mounts solved from them.

    `origin` says which way that is, None where the target is not symmetric; `undecided` are the views, by place in the
    session, that may have it another way round.
    """

    views: PoseViews
    solved: Solved
    origin: WorldOrigin | None
    undecided: Sequence[int]


def first_solution(session: Session, observations: Sequence[Observation], seen: CameraViews) -> Solution:
    """Solve the chain in closed form, with a symmetric target taken the same way round in all views.

    Raises UnsolvableError that names the joint or camera which the views do not determine.
    """
    if not session.joints:
        return Solution(Chain.of([], [], [], []), None, seen.lenses)
    read = read_one_way(session, observations, seen, partial(solve_chain, session))
    return Solution(*read.solved, seen.lenses, read.origin, read.undecided)


def read_one_way(
    session: Session,
    observations: Sequence[Observation],
    seen: CameraViews,
    solve: Callable[[PoseViews], Solved],
) -> ReadOneWay:
    """Return all views with a symmetric target the way round that the session's origin says, or its first view.

    Raises what `solve` raises.
    """
    views = PoseViews.of(session, [observation.view for observation in observations], seen.poses)
    symmetries = target_symmetries(session.target)
    if not symmetries:
        return ReadOneWay(views, solve(views), session.origin, ())
    turnable = np.array([observation.pose is None for observation in observations])
    units = [nominal_scale(joint.kind, joint.reading_unit) for joint in session.joints]
    found = oriented(views, symmetries, turnable, solve, units)
    views, undecided = replace(views, poses=found.poses), [observations[i].view for i in found.undecided]
    solution = Solution(*found.solved, seen.lenses)
    if session.origin is None:
        origin = _first_origin(session, solution, observations[0].view)
        return ReadOneWay(views, found.solved, origin, undecided)
    turn = _turn_to_origin(session, session.origin, solution, symmetries)
    if turn is None:
        return ReadOneWay(views, found.solved, session.origin, undecided)
    views = replace(views, poses=turn.turned_from_world @ views.poses)
    return ReadOneWay(views, solve(views), session.origin, undecided)


def _first_origin(session: Session, solution: Solution, view: int) -> WorldOrigin | None:
    """Return where `view` sees the world's origin: the choice that later solutions keep."""
    seen = session.views[view]
    camera = session.camera_index(seen)
    pixel = _pixel_of(session, solution, camera, seen.readings, np.zeros(3))
    if pixel is None:
        return None
    return WorldOrigin(
        camera=session.cameras[camera].name, readings=seen.readings, pixel=[*map(float, pixel)]
    )


def _turn_to_origin(
    session: Session, origin: WorldOrigin, solution: Solution, symmetries: Sequence[TargetSymmetry]
) -> TargetSymmetry | None:
    """Return the turn of the world after which its origin is seen where `origin` says; None for none."""
    points = target_points(session.target)
    camera = [camera.name for camera in session.cameras].index(origin.camera)
    corners = [points[0], *(points[turn.permutation[0]] for turn in symmetries)]
    seen = [_pixel_of(session, solution, camera, origin.readings, corner) for corner in corners]
    misses = [np.inf if pixel is None else float(np.linalg.norm(pixel - origin.pixel)) for pixel in seen]
    best = int(np.argmin(misses))
    return None if best == 0 else symmetries[best - 1]


def _pixel_of(
    session: Session, solution: Solution, camera: int, readings: list[float], point: Array
) -> Array | None:
    lens = solution.lenses[camera]
    if lens is None or solution.mounts is None:
        return None
    pose = solution.chain.poses(readings, session.camera_link(camera), solution.mounts[camera])
    pixel = project_points((inverse(pose) @ [*point, 1.0])[:3], lens)
    return pixel if np.isfinite(pixel).all() else None
