"""How well a calibration explains the views that it was made from, and those held out."""

from collections.abc import Sequence

from calib.calibration import Calibration, Quality, ViewQuality
from calib.observations import Observation
from calib.residuals import root_mean_square, view_residual
from calib.session import Session


def judged(
    calibration: Calibration, session: Session, observations: Sequence[Observation], warnings: list[str]
) -> Quality:
    """Return how well the calibration explains each view, those of the fit and those held out."""
    residuals = [view_residual(calibration, session, observation) for observation in observations]
    views = [
        ViewQuality(
            view=residual.view,
            joint=session.views[residual.view].joint,
            use=session.views[residual.view].use,
            rms_px=root_mean_square([residual]),
            position_m=residual.position,
            rotation_rad=residual.rotation,
        )
        for residual in residuals
    ]
    by_use = {use: [r for r in residuals if session.views[r.view].use == use] for use in ("fit", "verify")}
    return Quality(
        rms_px=root_mean_square(by_use["fit"]),
        held_out_rms_px=root_mean_square(by_use["verify"]),
        views=views,
        warnings=warnings,
    )
