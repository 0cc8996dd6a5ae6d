"""From a session to a calibration."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from calib.calibration import (
    CALIBRATION_FORMAT,
    CalibratedCamera,
    Calibration,
    DhLink,
    JointScrew,
    Quality,
    ViewQuality,
)
from calib.chain import Chain
from calib.closed_form import PoseViews, solve_chain
from calib.errors import UnsolvableError
from calib.lens import project_points
from calib.lens_calibration import calibrate_camera
from calib.links import Links, links_of
from calib.observations import Observation, Observed, Progress, observe
from calib.orientation import agreed, carried_on
from calib.residuals import root_mean_square, view_residual
from calib.session import Camera, Intrinsics, Session, WorldOrigin
from calib.targets import AsymmetricCircleGrid, CircleGrid, TargetSymmetry, target_points, target_symmetries
from calib.transforms import inverse
from calib.unfinished import finished_part

Array = NDArray[np.float64]
Method = Literal["closed_form"]


@dataclass(frozen=True, eq=False)
class Solution:
    """The chain, each camera's pose at all readings 0 (cameras, 4, 4), and the choice of a world's origin."""

    chain: Chain
    mounts: Array | None
    lenses: list[Intrinsics | None]
    origin: WorldOrigin | None


def solve(session: Session, method: Method = "closed_form", progress: Progress | None = None) -> Calibration:
    """Calibrate the active camera of `session`: chain, camera on it, base and lens, with no initial guess.

    `progress` is told what is being done. Views marked `verify` are held out; they only enter the quality. A
    session that was cut off (`complete` is false) is solved as far as it goes, for the joints that were
    exercised. Raises UnsolvableError, which names the joint or view and what would help, and ImageError for
    a missing picture.
    """
    session, cut_off = finished_part(session)
    observed = observe(session, progress)
    if progress is not None:
        progress("solving")
    fit = [o for o in observed.observations if session.views[o.view].use == "fit"]
    if not fit:
        raise UnsolvableError(
            "the target was seen only in views that are held out: some must have the use 'fit'"
        )
    poses, lenses, warnings = _camera_views(session, fit)
    if session.joints:
        solution = _solve_chain(session, fit, poses, lenses)
    else:
        solution = Solution(Chain.of([], [], [], []), None, lenses, None)
    calibration = _document(session, method, solution)
    if cut_off is not None:
        warnings.insert(0, cut_off)
    return calibration.model_copy(update={"quality": _quality(calibration, session, observed, warnings)})


def _camera_views(
    session: Session, observations: list[Observation]
) -> tuple[Array, list[Intrinsics | None], list[str]]:
    """Return the camera's pose in every view (n, 4, 4), the lens of each camera, and warnings about them."""
    points, target = target_points(session.target), session.target
    diameter = target.disk_diameter if isinstance(target, CircleGrid | AsymmetricCircleGrid) else None
    poses = np.zeros((len(observations), 4, 4))
    lenses: list[Intrinsics | None] = []
    warnings: list[str] = []
    for index, camera in enumerate(session.cameras):
        lens = camera.intrinsics
        own = [i for i, o in enumerate(observations) if o.camera == index and o.pose is None]
        if own:
            views = [observations[i] for i in own]
            try:
                found = calibrate_camera(points, views, _picture_size(camera), diameter, lens)
            except UnsolvableError as error:
                raise UnsolvableError(f"camera '{camera.name}': {error}") from error
            lens, poses[own] = found.lens, found.poses
            warnings += [f"camera '{camera.name}': {warning}" for warning in found.warnings]
        lenses.append(lens)
    for i, observation in enumerate(observations):
        if observation.pose is not None:
            poses[i] = observation.pose
    return poses, lenses, warnings


def _picture_size(camera: Camera) -> tuple[int, int]:
    if camera.width is None or camera.height is None:
        raise UnsolvableError("its width and height are not given; add them to the session's cameras")
    return camera.width, camera.height


def _solve_chain(
    session: Session, observations: list[Observation], poses: Array, lenses: list[Intrinsics | None]
) -> Solution:
    """Solve the chain, with a symmetric target taken the same way round in all views."""
    views = PoseViews.of(session, [observation.view for observation in observations], poses)
    symmetries = target_symmetries(session.target)

    def solved(poses: Array) -> tuple[Chain, Array]:
        return solve_chain(session, replace(views, poses=poses))

    if not symmetries:
        return Solution(*solved(poses), lenses, None)
    turnable = np.array([observation.pose is None for observation in observations])
    views = replace(views, poses=carried_on(views, symmetries, turnable))
    poses, (chain, mounts) = agreed(views, symmetries, turnable, solved)
    solution = Solution(chain, mounts, lenses, session.origin)
    if session.origin is None:
        return replace(solution, origin=_first_origin(session, solution, observations[0].view))
    turn = _turn_to_origin(session, session.origin, solution, symmetries)
    return solution if turn is None else replace(solution, **_named(solved(turn.turned_from_world @ poses)))


def _named(solved: tuple[Chain, Array]) -> dict[str, Any]:
    return {"chain": solved[0], "mounts": solved[1]}


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


def _document(session: Session, method: Method, solution: Solution) -> Calibration:
    """Return the solution as a calibration whose quality is still to be judged."""
    chain, links = solution.chain, links_of(solution.chain)
    ranges = session.with_views([view for view in session.views if view.use == "fit"]).readings()
    return Calibration(
        format=CALIBRATION_FORMAT,
        method=method,
        joints=[
            JointScrew(
                name=joint.name,
                kind=joint.kind,
                reading_unit=joint.reading_unit,
                scale=float(chain.scales[i]),
                scale_std=None,
                axis=chain.axes[i].tolist(),
                point=chain.points[i].tolist(),
            )
            for i, joint in enumerate(session.joints)
        ],
        dh=[
            DhLink(**asdict(row), scale=float(scale))
            for row, scale in zip(links.rows, chain.scales, strict=True)
        ],
        world_from_base=links.world_from_base.tolist(),
        cameras=[_camera(session, index, solution, links) for index in range(len(session.cameras))],
        corrections={},
        range=[[float(lo), float(hi)] for lo, hi in zip(ranges.min(axis=0), ranges.max(axis=0), strict=True)],
        covariance=None,
        quality=Quality(rms_px=None, held_out_rms_px=None, views=[], warnings=[]),
        target=session.target,
        origin=solution.origin,
    )


def _camera(session: Session, index: int, solution: Solution, links: Links) -> CalibratedCamera:
    name, lens, link = session.cameras[index].name, solution.lenses[index], session.camera_link(index)
    if solution.mounts is None:
        return CalibratedCamera(
            name=name, link=None, link_from_camera=None, intrinsics=lens, world_from_camera=None
        )
    mount = solution.mounts[index]
    return CalibratedCamera(
        name=name,
        link=session.joints[link - 1].name,
        link_from_camera=(inverse(links.world_from_link[link - 1]) @ mount).tolist(),
        intrinsics=lens,
        world_from_camera=mount.tolist(),
    )


def _quality(calibration: Calibration, session: Session, observed: Observed, warnings: list[str]) -> Quality:
    """Return how well the calibration explains each view, those of the fit and those held out."""
    residuals = [view_residual(calibration, session, observation) for observation in observed.observations]
    placed = bool(calibration.joints)
    views = [
        ViewQuality(
            view=residual.view,
            joint=session.views[residual.view].joint,
            use=session.views[residual.view].use,
            rms_px=root_mean_square([residual]),
            position_m=residual.position if placed else None,
            rotation_rad=residual.rotation if placed else None,
        )
        for residual in residuals
    ]
    by_use = {use: [r for r in residuals if session.views[r.view].use == use] for use in ("fit", "verify")}
    return Quality(
        rms_px=root_mean_square(by_use["fit"]),
        held_out_rms_px=root_mean_square(by_use["verify"]),
        views=views,
        warnings=[*warnings, *observed.missing],
    )
