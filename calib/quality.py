"""How well a calibration explains the views that it was made from, and those held out."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from math import sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.calibration import Calibration
from calib.coverage import coverage, missing_in_words
from calib.observations import Observation
from calib.residuals import ViewResidual, view_residuals
from calib.session import Session
from calib.slips import slips_in_words
from calib.solution import Solution
from calib.stated_quality import CameraCoverage, JointQuality, MeanAndMax, Quality, ViewQuality
from calib.verdict import judgement_and_verdict

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Miss:
    """How far `points` points lie from where they are predicted (rms), or a given pose; None for what is not there."""

    points: int
    pixels: float | None
    position: float | None
    rotation: float | None

    @classmethod
    def of(cls, residual: ViewResidual, bad: Sequence[int] = ()) -> "Miss":
        """Return the miss of one view, points with the ids `bad` not counted."""
        errors = residual.errors
        if bad:
            errors = errors[~np.isin(residual.ids, bad)]
        pixels = float(np.sqrt((errors**2).mean())) if len(errors) else None
        return cls(len(errors), pixels, residual.position, residual.rotation)

    @classmethod
    def over(cls, misses: Iterable["Miss"]) -> "Miss":
        """Return the miss of several views: pixels over all points, positions and rotations on the mean."""
        misses = list(misses)
        seen = [(miss.points, miss.pixels) for miss in misses if miss.pixels is not None]
        points = sum(count for count, _ in seen)
        return cls(
            points,
            sqrt(sum(count * pixels**2 for count, pixels in seen) / points) if points else None,
            _mean([miss.position for miss in misses]),
            _mean([miss.rotation for miss in misses]),
        )


def judged(
    calibration: Calibration,
    session: Session,
    observations: Sequence[Observation],
    solution: Solution,
    warnings: list[str],
) -> Quality:
    """Return how well the calibration explains each view, those of the fit and those held out.

    Where no view is marked `verify`, the solution's fit tells how well each is predicted by the others. What was set
    aside counts nowhere but in its own view.
    """
    residuals = view_residuals(calibration, session, observations)
    aside = set(solution.left_out[0])
    bad: dict[int, list[int]] = {}
    for view, point in solution.left_out[1]:
        bad.setdefault(view, []).append(point)
    uses = {residual.view: session.views[residual.view].use for residual in residuals}
    misses = {residual.view: Miss.of(residual) for residual in residuals}
    fitted = {
        residual.view: Miss.of(residual, bad[residual.view])
        if residual.view in bad
        else misses[residual.view]
        for residual in residuals
        if uses[residual.view] == "fit" and residual.view not in aside
    }
    verify = {view: miss for view, miss in misses.items() if uses[view] == "verify"}
    by_others = {
        error.view: Miss(fitted[error.view].points, error.rms_px, error.position_m, error.rotation_rad)
        for error in (solution.refined.held_out() if solution.refined else ())
    }
    held_out = verify or by_others
    held_out_by: Literal["verify", "leave_one_view_out"] = "verify" if verify else "leave_one_view_out"
    views = []
    for residual in residuals:
        alone = by_others.get(residual.view)
        views.append(
            ViewQuality(
                view=residual.view,
                joint=session.views[residual.view].joint,
                use=uses[residual.view],
                rms_px=misses[residual.view].pixels,
                position_m=residual.position,
                rotation_rad=residual.rotation,
                held_out_px=alone and alone.pixels,
                held_out_position_m=alone and alone.position,
                held_out_rotation_rad=alone and alone.rotation,
                set_aside=residual.view in aside,
            )
        )
    every, out = Miss.over(fitted.values()), Miss.over(held_out.values())
    position, rotation = _pose_std(calibration, session, list(fitted))
    quality = Quality(
        rms_px=every.pixels,
        held_out_rms_px=out.pixels,
        held_out_position_m=out.position,
        held_out_rotation_rad=out.rotation,
        held_out_by=held_out_by if held_out else None,
        noise_px=solution.noise_px,
        predicted_px=solution.refined.predicted_miss() if solution.refined else None,
        position_std_m=position,
        rotation_std_rad=rotation,
        coverage=_coverage(calibration, session, [o for o in observations if o.view in fitted]),
        joints=_by_joint(session, fitted, held_out),
        views=views,
        warnings=warnings,
    )
    slips = slips_in_words(solution.slips, session.joints)
    judgement, verdict = judgement_and_verdict(quality, session.complete, solution.weaknesses, slips)
    return quality.model_copy(update={"judgement": judgement, "verdict": verdict})


def _coverage(
    calibration: Calibration, session: Session, observations: Sequence[Observation]
) -> list[CameraCoverage]:
    """Return how the fit's views cover the picture of each camera whose lens they tell of."""
    rows = []
    for index, (given, camera) in enumerate(zip(session.cameras, calibration.cameras, strict=True)):
        lens = camera.intrinsics
        if lens is None or lens.width is None or lens.height is None:
            continue
        size = lens.width, lens.height
        covered = coverage(session.target, size, [o for o in observations if o.camera == index])
        # What is missing of a lens that is known already is not missed.
        missing = [] if given.intrinsics is not None else missing_in_words(covered)
        rows.append(CameraCoverage(camera=camera.name, missing=missing, **asdict(covered)))
    return rows


def _by_joint(session: Session, fitted: dict[int, Miss], held_out: dict[int, Miss]) -> list[JointQuality]:
    names: list[str | None] = [*(joint.name for joint in session.joints), None]
    rows = []
    for name in names:
        own = [miss for view, miss in fitted.items() if session.views[view].joint == name]
        unseen = [miss for view, miss in held_out.items() if session.views[view].joint == name]
        if own or unseen:
            every, out = Miss.over(own), Miss.over(unseen)
            rows.append(
                JointQuality(
                    joint=name,
                    views=len(own),
                    rms_px=every.pixels,
                    position_m=every.position,
                    rotation_rad=every.rotation,
                    held_out_px=out.pixels,
                    held_out_position_m=out.position,
                    held_out_rotation_rad=out.rotation,
                )
            )
    return rows


def _pose_std(
    calibration: Calibration, session: Session, views: Sequence[int]
) -> tuple[MeanAndMax | None, MeanAndMax | None]:
    """Return how sure the pose is at the readings of these views: its position (m), its rotation (rad)."""
    positions, rotations = [], []
    for index, camera in enumerate(session.cameras):
        own = [view for view in views if session.camera_index(session.views[view]) == index]
        if not own:
            continue
        covariance = calibration.pose_covariance(session.readings()[own], camera.name, session.sides()[own])
        if covariance is None:
            continue
        variances = np.diagonal(covariance, axis1=1, axis2=2)
        rotations += np.sqrt(variances[:, :3].sum(axis=1)).tolist()
        positions += np.sqrt(variances[:, 3:].sum(axis=1)).tolist()
    return _spread(positions), _spread(rotations)


def _spread(values: Sequence[float]) -> MeanAndMax | None:
    return MeanAndMax(mean=sum(values) / len(values), max=max(values)) if values else None


def _mean(errors: Sequence[float | None]) -> float | None:
    known = [error for error in errors if error is not None]
    return sum(known) / len(known) if known else None
