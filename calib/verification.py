"""Is the result good? The paper's two verifications, on views that the calibration has not seen.

Method 1 compares how far each joint moved the camera, as the calibration predicts it from the readings,
with the camera poses of the pictures themselves, and with the encoder's own measure where its unit is
trusted (tables 1, 2). Method 2 compares predicted image points with measured ones (tables 3, 4).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from calib.calibration import Calibration
from calib.closed_form import PoseViews
from calib.errors import FormatError
from calib.observations import Observed, Progress, observe
from calib.prediction import by_calibration
from calib.residuals import ViewResidual, view_residuals
from calib.second_look import second_look
from calib.session import JointKind, Session
from calib.sweeps import sweep_labels
from calib.transforms import inverse, rotation_log
from calib.units import nominal_scale

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """Mean and largest of some errors."""

    mean: float
    max: float


@dataclass(frozen=True)
class ViewVerdict:
    """One view's errors; None for what it has no measure of."""

    view: int
    joint: str | None
    readings: list[float]
    points: int
    mean_px: float | None
    rms_px: float | None
    max_px: float | None
    position_m: float | None
    rotation_rad: float | None


@dataclass(frozen=True)
class Travel:
    """A joint's travel between a sweep's first view and another one (m or rad), with growing reading.

    `predicted` by the calibration, `measured` between the camera poses of the two pictures, `encoder` by the
    readings' own unit, None where that is not trusted.
    """

    view: int
    reading: float
    predicted: float
    measured: float
    encoder: float | None


@dataclass(frozen=True)
class JointTravel:
    """Method 1 for one joint, from one start."""

    joint: str
    kind: JointKind
    start: list[float]
    rows: list[Travel]


@dataclass(frozen=True)
class Verification:
    """The verdict of views that the fit has not used. Pixels are over points, the rest over views.

    A position is where the target lies in the camera's frame; None for what the session has no measure of.
    """

    views: int
    mean_px: float | None
    rms_px: float | None
    max_px: float | None
    position_m: Spread | None
    rotation_rad: Spread | None
    per_view: list[ViewVerdict]
    travel: list[JointTravel]
    warnings: list[str]


def verify(calibration: Calibration, session: Session, progress: Progress | None = None) -> Verification:
    """Judge `calibration` on the views of `session`: those marked `verify`, or all that are used where none is.

    Raises FormatError where the session's joints or cameras are not the calibration's, UnsolvableError
    where the target is never seen, ImageError for a missing picture.
    """
    marked = any(view.use == "verify" for view in session.views)
    use = "verify" if marked else "fit"
    judged = [index for index, view in enumerate(session.views) if view.use == use]
    observed, residuals = compare(calibration, session, judged, progress)
    errors = np.concatenate([residual.errors for residual in residuals])
    placed = bool(calibration.joints)
    return Verification(
        views=len(residuals),
        mean_px=float(errors.mean()) if len(errors) else None,
        rms_px=float(np.sqrt((errors**2).mean())) if len(errors) else None,
        max_px=float(errors.max()) if len(errors) else None,
        position_m=_spread([residual.position for residual in residuals]),
        rotation_rad=_spread([residual.rotation for residual in residuals]),
        per_view=[_verdict(session, residual) for residual in residuals],
        travel=_travels(calibration, session, residuals) if placed else [],
        warnings=observed.warnings(session),
    )


def compare(
    calibration: Calibration, session: Session, views: Sequence[int], progress: Progress | None = None
) -> tuple[Observed, list[ViewResidual]]:
    """Return what these `views` of a session show, by place, and how far that is from what `calibration` predicts.

    Raises as `verify` does.
    """
    _require_same_rig(calibration, session)
    seen, predict = observe(session, progress, views), by_calibration(calibration, session)
    observed = second_look(session, seen, predict, progress)
    return observed, view_residuals(calibration, session, observed.observations, measure_pose=True)


def _require_same_rig(calibration: Calibration, session: Session) -> None:
    calibrated, found = [j.name for j in calibration.joints], [j.name for j in session.joints]
    if calibrated != found:
        raise FormatError(
            f"the session's joints ({', '.join(found) or 'none'}) are not the calibration's "
            f"({', '.join(calibrated) or 'none'}): they must be the same, in the same order"
        )
    for camera in session.cameras:
        calibration.camera_index(camera.name)


def _verdict(session: Session, residual: ViewResidual) -> ViewVerdict:
    view, errors = session.views[residual.view], residual.errors
    seen = len(errors) > 0
    return ViewVerdict(
        view=residual.view,
        joint=view.joint,
        readings=view.readings,
        points=len(errors),
        mean_px=float(errors.mean()) if seen else None,
        rms_px=float(np.sqrt((errors**2).mean())) if seen else None,
        max_px=float(errors.max()) if seen else None,
        position_m=residual.position,
        rotation_rad=residual.rotation,
    )


def _travels(
    calibration: Calibration, session: Session, residuals: Sequence[ViewResidual]
) -> list[JointTravel]:
    """Return method 1 for every sweep of every joint."""
    measured = np.array([_measured(residual) for residual in residuals])
    views = PoseViews.of(session, [residual.view for residual in residuals], measured)
    labels = sweep_labels(views.readings, views.exercised, views.cameras, views.links)
    travels = []
    for joint in range(len(session.joints)):
        for sweep in np.unique(labels[labels[:, joint] >= 0, joint]):
            members = np.flatnonzero(labels[:, joint] == sweep)
            members = members[np.argsort(views.readings[members, joint], kind="stable")]
            travels.append(_travel(calibration, session, joint, [residuals[i] for i in members.tolist()]))
    return travels


def _travel(
    calibration: Calibration, session: Session, index: int, residuals: Sequence[ViewResidual]
) -> JointTravel:
    joint, start = session.joints[index], residuals[0]
    trusted = nominal_scale(joint.kind, joint.reading_unit) if joint.unit_trusted else None
    first = session.views[start.view].readings
    rows = []
    for end in residuals[1:]:
        reading = session.views[end.view].readings[index]
        step = reading - first[index]
        expected = calibration.joints[index].scale * step
        rows.append(
            Travel(
                view=end.view,
                reading=reading,
                predicted=_moved(joint.kind, start.predicted, end.predicted, expected),
                measured=_moved(joint.kind, _measured(start), _measured(end), expected),
                encoder=None if trusted is None else trusted * step,
            )
        )
    return JointTravel(joint.name, joint.kind, first, rows)


def _measured(residual: ViewResidual) -> Array:
    assert residual.measured is not None
    return residual.measured


def _moved(kind: JointKind, start: Array, end: Array, expected: float) -> float:
    """Return the distance (m) or angle (rad) between two poses; `expected` tells the whole turns."""
    if kind == "prismatic":
        return float(np.linalg.norm(end[:3, 3] - start[:3, 3]))
    angle = float(np.linalg.norm(rotation_log((end @ inverse(start))[None])))
    candidates = [
        sign * angle + 2 * np.pi * round((expected - sign * angle) / (2 * np.pi)) for sign in (1, -1)
    ]
    return min(candidates, key=lambda candidate: abs(candidate - expected))


def _spread(errors: Sequence[float | None]) -> Spread | None:
    known = [error for error in errors if error is not None]
    return Spread(mean=float(np.mean(known)), max=float(np.max(known))) if known else None


VERIFICATION: TypeAdapter[Verification] = TypeAdapter(Verification)
"""Reads a verification back from the JSON value that it was written as."""
