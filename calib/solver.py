"""From a session to a calibration."""

from collections.abc import Mapping, Sequence

from calib.advice import weakness_in_words
from calib.as_solved import read_by_fit, stating_readings
from calib.calibration import Calibration
from calib.corrections_in_words import FLAT, corrections_in_words, unused_warp_in_words
from calib.document import Method, document
from calib.errors import UnsolvableError
from calib.first_solution import CameraViews, camera_views, first_solution
from calib.lens_calibration import lens_in_words
from calib.most_likely import left_out_in_words, most_likely
from calib.nominal import nominal_solution
from calib.observations import Observation, Progress, observe
from calib.orientation import undecided_in_words
from calib.parameters import Held
from calib.prediction import predicted_by_views
from calib.quality import judged
from calib.second_look import second_look
from calib.session import Session
from calib.slips import slips_in_words
from calib.solution import Solution
from calib.stated_quality import Quality
from calib.targets import target_points
from calib.unfinished import finished_part


def solve(
    session: Session,
    method: Method = "ml",
    progress: Progress | None = None,
    hold: Mapping[str, Held | None] | None = None,
    target_warp: bool = False,
) -> Calibration:
    """Calibrate the active camera of `session`: chain, camera on it, base and lens, with no initial guess.

    `ml` is the maximum-likelihood fit with its uncertainty, `closed_form` the paper's method, from which it starts.
    `progress` is told what is being done. Views marked `verify` are held out; they only enter the quality, and those
    marked `none` nothing but their own line in it. A session that was cut off (`complete` is false) is solved as far
    as it goes, for the joints that were exercised. `hold` are parameters to be kept at a value, by name, beside those
    that the session holds (`calib.parameters`). With `target_warp` the fit lets the target bulge, if the data support
    it. Raises FormatError for a parameter that there is not, UnsolvableError, which names the joint or view and what
    would help, and ImageError for a missing picture.
    """
    part = finished_part(session.holding(hold or {}))
    session = part.session
    observed = second_look(
        session,
        observe(session, progress),
        lambda seen, view: predicted_by_views(session, seen, view.readings, session.camera_index(view)),
        progress,
    )
    if progress is not None:
        progress("solving")
    fit = [o for o in observed.observations if session.views[o.view].use == "fit"]
    if not fit:
        raise UnsolvableError(
            "the target was seen only in views that are held out: some must have the use 'fit'"
        )
    seen = camera_views(session, fit)
    solution = _start(session, fit, seen, method)
    fitted = method == "ml" and bool(session.joints)
    if fitted:
        solution = most_likely(session, fit, solution, target_warp)
    warnings = [] if part.sentence is None else [part.sentence]
    warnings += undecided_in_words(solution.undecided, session.target.kind)
    units = {joint.name: joint.reading_unit for joint in session.joints}
    warnings += [weakness_in_words(weakness, units) for weakness in solution.weaknesses]
    for camera, std in zip(session.cameras, seen.focal_std, strict=True):
        if std is None or not fitted:
            warnings += lens_in_words(camera.name, std)
    points = target_points(session.target)
    warnings += slips_in_words(solution.slips, session.joints)
    warnings += [*left_out_in_words(solution), *unused_warp_in_words(solution.unused_warp, points)]
    warnings += observed.warnings(session)
    calibration = document(session, method, solution, Quality())
    known = read_by_fit(session, solution)
    quality = judged(calibration, known, observed.observations, solution, warnings)
    quality = stating_readings(quality, session, solution, part.places)
    corrected = corrections_in_words(calibration.corrections, session.joints, points)
    if target_warp and not solution.warp:
        corrected.append(FLAT)
    quality = quality.model_copy(update={"corrections": corrected})
    return calibration.model_copy(update={"quality": quality})


def _start(
    session: Session, observations: Sequence[Observation], seen: CameraViews, method: Method
) -> Solution:
    """Return the closed form's solution, or for the fit that of a drawing where the session has one."""
    if session.nominal is None or method == "closed_form":
        return first_solution(session, observations, seen)
    return nominal_solution(session, session.nominal, observations, seen)
