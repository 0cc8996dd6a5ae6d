"""The mathematics of an active camera's calibration, and its two file formats.

    session = load_session("sessions/monday")
    calibration = solve(session)
    calibration.world_from_camera([12.5, 30.0])     # 4 x 4

`solve` and `verify` are loaded when first used: who only asks for poses does not wait for the solver. The rooms, as
data flows through them:

    session, views, intrinsics, targets   what was measured, by and of what;  documents, session_writer  on disk
    ink                          what is black on a printed target
    picture_file, detection/, observations   the target's points in every picture;  coverage  of the picture by them
    parameters, lens_prior, held_chain           what is known beforehand
    lens, disks, tsai            lens models;  homography, bundle, lens_calibration, pose_from_view  lens and poses
    transforms, twists, chain    rigid motions, and the chain as a product of exponentials
    sweeps, screws, closed_form  the paper's method;  orientation  of symmetric targets;  first_solution  all of it
    nominal, unfinished          sessions with a drawing, and sessions that were cut off
    prediction, second_look      where the target should be, and what is found of it there
    likelihood/, most_likely     the fit;  advice  what it does not tell, in words
    corrections, warp, pose_sensor               imperfect joints, targets and sensors;  slips  of joints
    stated_corrections, corrections_in_words     what they are, said;  stated_quality  and how good it is
    links, dh, document          D-H and base read off the screws, and all written down: calibration
    pose_covariance, projection, dh_covariance   how sure a pose is, where a point is seen, and a D-H parameter
    residuals, quality, verdict, verification  is it good?  own_fit, residual_map  what to look at where it is not;
    as_solved                    a session's readings as the fit found them
    scene, comparison            the rig in 3-D; two calibrations of it side by side
    paper, paper_tables, stated_parameters     the paper's tables, ours beside them, and all parameters in a row
    solver                       from a session to a calibration
"""

from typing import TYPE_CHECKING, Any

from calib.calibration import Calibration, load_calibration, save_calibration
from calib.errors import CalibError
from calib.session import Session, View, load_session

if TYPE_CHECKING:
    from calib.solver import solve
    from calib.verification import Verification, verify

__all__ = [
    "CalibError",
    "Calibration",
    "Session",
    "Verification",
    "View",
    "load_calibration",
    "load_session",
    "save_calibration",
    "solve",
    "verify",
]

_LAZY = {"Verification": "calib.verification", "solve": "calib.solver", "verify": "calib.verification"}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        from importlib import import_module

        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module 'calib' has no attribute {name!r}")
