"""Where a camera sees the target's points, before anybody looks: from a calibration, or from the other views.

The other views tell by what they say of lens and chain in closed form. How far that may be off is seen where the truth
is known: the view nearest in readings is predicted by the rest.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.calibration import Calibration
from calib.detection import Prediction
from calib.errors import UnsolvableError
from calib.first_solution import camera_views, first_solution
from calib.lens import pixel_rays
from calib.nominal import nominal_solution
from calib.observations import Observation
from calib.projection import projected
from calib.residuals import misfits, read_as_predicted
from calib.second_look import Predict
from calib.session import Intrinsics, Session, View
from calib.targets import Target, target_points
from calib.unfinished import part_about

Array = NDArray[np.float64]

SURE = 4.0
"""How many standard deviations, or times the miss of the nearest view, a prediction may be off."""
LEAST_OFF = 2.0
"""Pixels that any prediction may be off."""
FARTHEST = 0.4
"""How far that may be, of the distance to the next point: from half of it on, a point is nearer to that."""
SAME_RAY = 1e-6


def predicted_by_calibration(
    calibration: Calibration,
    target: Target,
    readings: Sequence[float],
    camera: str | None = None,
    approached: Sequence[int] | None = None,
) -> Prediction:
    """Return where a calibrated camera sees the target at `readings`.

    It may be off by four standard deviations, of the calibration and of its views' residuals together; of the latter
    alone where it does not know the former. Raises CalibError for a camera whose lens or place it does not know, and
    UnsolvableError where neighbouring points may be confused, or none is in the picture.
    """
    points = calibration.points_of(target)
    seeing = calibration.cameras[calibration.camera_index(camera)]
    lens = seeing.intrinsics
    if lens is None:
        raise UnsolvableError(f"the lens of camera '{seeing.name}' is not known")
    pose = calibration.world_from_camera(readings, camera, approached)
    ids, pixels = _in_picture(points, pose, lens)
    known = calibration.projection_covariance(points[ids], readings, camera, approached)
    variance = (calibration.quality.rms_px or 0.0) ** 2
    if known is not None:
        variance += float(np.trace(known, axis1=-2, axis2=-1).max())
    return _prediction(points, ids, pixels, SURE * float(np.sqrt(variance)))


def by_calibration(calibration: Calibration, session: Session) -> Predict:
    """Return what tells a second look where `calibration` has the target in a view of `session`."""

    def predict(_: Sequence[Observation], view: View) -> Prediction:
        camera = session.cameras[session.camera_index(view)].name
        return predicted_by_calibration(calibration, session.target, view.readings, camera, view.approached)

    return predict


def predicted_by_views(
    session: Session, observations: Sequence[Observation], readings: Sequence[float], camera: int = 0
) -> Prediction:
    """Return where a camera, by its place, sees the target at `readings`, by what `observations` of views tell.

    It may be off by four times as much as the seen view nearest to it is missed by the prediction of all others.
    Raises UnsolvableError where the views do not tell, neighbouring points may be confused, or none is in the picture.
    """
    points = target_points(session.target)
    used = [o for o in observations if session.views[o.view].use == "fit"]
    nearest = _nearest(session, [o for o in used if o.camera == camera and o.pose is None], readings)
    others = [o for o in used if o is not nearest]
    lens, pose = _seen_from(session, others, session.views[nearest.view].readings, camera)
    (seen,) = read_as_predicted([nearest], session.target, lens, pose[None])
    missed = misfits([seen], session.target, points, lens, pose[None])[0]
    lens, pose = _seen_from(session, used, readings, camera)
    off = SURE * float(np.linalg.norm(missed, axis=1).max())
    return _prediction(points, *_in_picture(points, pose, lens), off)


def _in_picture(points: Array, pose: Array, lens: Intrinsics) -> tuple[NDArray[np.int64], Array]:
    """Return which of the target's points (p, 3) a camera at `pose` (4, 4) has in its picture (n,), and where (n, 2).

    Raises UnsolvableError where it has none.
    """
    pixels = projected(points, pose, lens)
    rays = (points - pose[:3, 3]) @ pose[:3, :3]
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    # Far aside a distortion may bend back into the picture what is not in it, and another ray leads there.
    inside = np.linalg.norm(pixel_rays(pixels, lens) - rays, axis=1) < SAME_RAY
    if lens.width is not None and lens.height is not None:
        inside &= ((pixels >= 0) & (pixels <= np.array([lens.width, lens.height]) - 1)).all(axis=1)
    if not inside.any():
        raise UnsolvableError("the target is predicted to be out of the picture")
    return np.flatnonzero(inside), pixels[inside]


def _prediction(points: Array, ids: NDArray[np.int64], pixels: Array, off: float) -> Prediction:
    """Return the prediction of points `ids` (n,) of all (p, 3); raises UnsolvableError where they may be confused."""
    off, apart = max(off, LEAST_OFF), np.linalg.norm(points[ids, None] - points[ids], axis=2)
    np.fill_diagonal(apart, np.inf)
    least = float(np.linalg.norm(pixels - pixels[apart.argmin(axis=1)], axis=1).min())
    if not off < FARTHEST * least:
        raise UnsolvableError(
            f"where the target's points are is predicted to within {off:.1f} px, and they are {least:.1f} px apart"
        )
    return Prediction(ids, pixels, off)


def _seen_from(
    session: Session, observations: Sequence[Observation], readings: Sequence[float], camera: int
) -> tuple[Intrinsics, Array]:
    """Return the lens of a camera and its pose (4, 4) at `readings`, in closed form."""
    seen = session.with_views([session.views[observation.view] for observation in observations])
    kept = list(range(len(observations)))
    if session.nominal is None:
        seen, kept, readings = part_about(seen, readings)
    renumbered = [replace(observations[place], view=number) for number, place in enumerate(kept)]
    try:
        views = camera_views(seen, renumbered)
        if session.nominal is None:
            solution = first_solution(seen, renumbered, views)
        else:
            solution = nominal_solution(seen, session.nominal, renumbered, views)
    except np.linalg.LinAlgError as error:
        raise UnsolvableError("the views so far do not determine lens and chain") from error
    lens = solution.lenses[camera]
    if lens is None or solution.mounts is None:
        raise UnsolvableError(f"the lens of camera '{session.cameras[camera].name}' is not known")
    return lens, solution.chain.poses(readings, seen.camera_link(camera), solution.mounts[camera])


def _nearest(session: Session, observations: Sequence[Observation], readings: Sequence[float]) -> Observation:
    """Return the observation at the readings nearest to `readings`, each joint's by its range."""
    if not observations:
        raise UnsolvableError("the camera has not seen the target yet")
    others = session.readings()[[observation.view for observation in observations]]
    span = np.ptp(others, axis=0)
    away = (others - readings) / np.where(span > 0, span, 1)
    return observations[int(np.argmin(np.linalg.norm(away, axis=1)))]
