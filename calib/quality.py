"""How well a calibration explains the views that it was made from, and those held out."""

from collections.abc import Sequence
from math import sqrt
from typing import Any

from calib.calibration import Calibration, Quality, ViewQuality
from calib.likelihood.held_out import HeldOut
from calib.observations import Observation
from calib.residuals import ViewResidual, root_mean_square, view_residuals
from calib.session import Session


def judged(
    calibration: Calibration,
    session: Session,
    observations: Sequence[Observation],
    left_one_out: Sequence[HeldOut],
    warnings: list[str],
) -> Quality:
    """Return how well the calibration explains each view, those of the fit and those held out.

    Where no view is marked `verify`, `left_one_out` tells how well each is predicted by the others.
    """
    residuals = view_residuals(calibration, session, observations)
    others = {error.view: error.rms_px for error in left_one_out}
    views = [
        ViewQuality(
            view=residual.view,
            joint=session.views[residual.view].joint,
            use=session.views[residual.view].use,
            rms_px=root_mean_square([residual]),
            position_m=residual.position,
            rotation_rad=residual.rotation,
            held_out_px=others.get(residual.view),
        )
        for residual in residuals
    ]
    fit, verify = (
        [residual for residual in residuals if session.views[residual.view].use == use]
        for use in ("fit", "verify")
    )
    held_out = _by_views(verify) if verify else _by_the_others(left_one_out, fit)
    return Quality(rms_px=root_mean_square(fit), **held_out, views=views, warnings=warnings)


def _by_views(verify: Sequence[ViewResidual]) -> dict[str, Any]:
    return {
        "held_out_rms_px": root_mean_square(verify),
        "held_out_position_m": _mean([residual.position for residual in verify]),
        "held_out_rotation_rad": _mean([residual.rotation for residual in verify]),
        "held_out_by": "verify",
    }


def _by_the_others(left_one_out: Sequence[HeldOut], fit: Sequence[ViewResidual]) -> dict[str, Any]:
    if not left_one_out:
        return {}
    points = {residual.view: len(residual.errors) for residual in fit}
    squares = [(points[error.view], error.rms_px**2) for error in left_one_out if error.rms_px is not None]
    count = sum(number for number, _ in squares)
    return {
        "held_out_rms_px": sqrt(sum(number * square for number, square in squares) / count)
        if count
        else None,
        "held_out_position_m": _mean([error.position_m for error in left_one_out]),
        "held_out_rotation_rad": _mean([error.rotation_rad for error in left_one_out]),
        "held_out_by": "leave_one_view_out",
    }


def _mean(errors: Sequence[float | None]) -> float | None:
    known = [error for error in errors if error is not None]
    return sum(known) / len(known) if known else None
