"""What a report says of a calibration, the verdict first, from all that is known of it."""

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from importlib.metadata import version

from calib import Calibration, load_session, verify
from calib.as_solved import as_solved
from calib.errors import CalibError
from calib.observations import observe
from calib.residual_map import ViewMisses, residual_map
from calib.session import Session
from calib.stated_quality import Quality
from calib.targets import Target
from calib.verification import VERIFICATION, Verification
from daemon.errors import ExportUnavailableError
from daemon.export.report import figures
from daemon.export.report.document import Block, Drawing, Facts, Heading, Panel, Report, Table, Verdict, Words
from daemon.export.report.numbers import figure, several
from daemon.export.report.tables import paper_tables, parameter_tables
from daemon.export.subject import Subject

ROTATION, POSITION = slice(0, 3), slice(3, 6)


def report(subject: Subject) -> Report:
    """Return the report; what needs the session says so where that cannot be read."""
    session, lack = _session(subject)
    told = None if session is None else (session.model_extra or {}).get("profile")
    joints = ", ".join(joint.name for joint in subject.calibration.joints)
    rig = subject.rig or told or joints or "a camera alone"
    return Report(f"Calibration: {rig}", list(_blocks(subject, session, lack)))


def _blocks(subject: Subject, session: Session | None, lack: str | None) -> Iterator[Block]:
    calibration = subject.calibration
    quality = calibration.quality
    yield Verdict(quality.judgement or "unknown", quality.verdict or "This calibration was not judged.")
    yield Facts(list(_facts(subject, session)))
    yield Heading("How good it is")
    yield Facts(list(_figures(quality)))
    if any(view.rms_px is not None for view in quality.views):
        caption = "Each view's points against the calibration; held-out views were not used to find it"
        if quality.held_out_by == "leave_one_view_out":
            caption = "Each view's points against the fit of all other views"
        yield Drawing([Panel(figures.view_errors(quality))], caption, 55)
    if calibration.covariance is not None and calibration.cameras[0].link_from_camera is not None:
        yield _certainty(calibration)
    verification = _verification(subject, session)
    yield Heading("Predicted against measured")
    yield from _predicted(verification, calibration)
    yield Heading("What is left over")
    if lack is not None:
        yield Words(f"Residuals by direction and by place are left out: {lack}.")
    if session is not None:
        yield from _residuals(subject, session)
    if quality.coverage:
        yield Heading("How the views cover the picture")
        for covered in quality.coverage:
            panels = [Panel(figures.cells_covered(covered)), Panel(figures.views_cover(covered), 0.7)]
            missing = "; ".join(covered.missing) or "nothing is left out"
            yield Drawing(panels, f"Camera '{covered.camera}', {covered.views} views: {missing}", 50)
    yield Heading("What was found")
    yield from parameter_tables(calibration)
    yield Heading("Corrections and warnings")
    yield from _remarks(calibration)
    if quality.views:
        yield Heading("The views")
        yield _views(quality, session)


def _facts(subject: Subject, session: Session | None) -> Iterator[tuple[str, str]]:
    calibration = subject.calibration
    if subject.rig is not None:
        yield "Rig", subject.rig
    taken = _taken(session)
    if taken:
        yield "Measured", f"{_time(min(taken))} to {_time(max(taken))}"
    if subject.made_at is not None:
        yield "Calibrated", _time(subject.made_at)
    if subject.owner:
        yield "By", subject.owner
    if subject.note:
        yield "Note", subject.note
    if subject.id is not None:
        yield "Calibration", subject.id
    if subject.folder is not None:
        yield "Session", subject.folder.name
    for joint, (low, high) in zip(calibration.joints, calibration.range, strict=True):
        yield f"Joint '{joint.name}'", f"{joint.kind}, from {low:.6g} to {high:.6g} {joint.reading_unit}"
    if calibration.target is not None and calibration.target.kind != "none":
        yield "Target", _target(calibration.target)
    method = "the most likely" if calibration.method == "ml" else "the paper's closed form"
    yield "Method", method
    yield "Software", f"activecam {version('activecam')} wrote this report"


def _taken(session: Session | None) -> list[datetime]:
    """Return when views were taken, where that is said."""
    views = [] if session is None else session.views
    said = [(view.model_extra or {}).get("time") for view in views]
    return [datetime.fromisoformat(time) for time in said if isinstance(time, str)]


def _time(time: datetime) -> str:
    return f"{time.astimezone(UTC):%Y-%m-%d %H:%M:%S} UTC"


def _target(target: Target) -> str:
    told = target.model_dump(exclude_none=True)
    lengths = ("pitch", "disk_diameter", "marker", "tag", "spacing", "pitch_std")
    sizes = [f"{name.replace('_', ' ')} {1e3 * told[name]:.6g} mm" for name in lengths if name in told]
    kind = target.kind.replace("_", " ")
    return ", ".join([f"{kind}, {told['rows']} rows of {told['columns']}", *sizes])


def _figures(quality: Quality) -> Iterator[tuple[str, str]]:
    fit = [view for view in quality.views if view.use == "fit"]
    held_out = [view for view in quality.views if view.use == "verify"]
    aside = [view for view in fit if view.set_aside]
    without = [view for view in quality.views if view.use == "none"]
    counts = [f"{len(fit)} to find it", f"{len(held_out)} held out"]
    counts += [f"{len(aside)} of them set aside"] if aside else []
    counts += [f"{len(without)} left out by hand"] if without else []
    yield "Views", ", ".join(counts)
    pixels = (
        ("Held-out points", quality.held_out_rms_px, "rms"),
        ("Points of the fit", quality.rms_px, "rms"),
        (
            "To be expected",
            quality.predicted_px,
            "rms, by noise of points and readings and the fit's own uncertainty",
        ),
        ("Noise of points", quality.noise_px, "rms, where each view's pose is free"),
    )
    for name, value, what in pixels:
        if value is not None:
            yield name, f"{figure(value)} px {what}"
    if quality.held_out_position_m is not None and quality.held_out_rotation_rad is not None:
        position, rotation = (
            figure(quality.held_out_position_m, 1e3),
            figure(quality.held_out_rotation_rad, 1e3),
        )
        yield "Held-out poses", f"{position} mm and {rotation} mrad on the mean"
    for name, spread, unit in (
        ("Position known to", quality.position_std_m, "mm"),
        ("Rotation known to", quality.rotation_std_rad, "mrad"),
    ):
        if spread is not None:
            mean, worst = figure(spread.mean, 1e3, 2), figure(spread.max, 1e3, 2)
            yield (
                name,
                f"{mean} {unit} on the mean of the calibrated range, {worst} {unit} at worst (standard deviations)",
            )


def _certainty(calibration: Calibration) -> Drawing:
    panels = [
        Panel(figures.certainty(calibration, POSITION, "position (mm, std)")),
        Panel(figures.certainty(calibration, ROTATION, "rotation (mrad, std)")),
    ]
    caption = (
        "How sure the camera's position (left) and rotation (right) are: one joint goes through its range, "
        "the others stand amid theirs; all three directions together"
    )
    return Drawing(panels, caption, 55)


def _session(subject: Subject) -> tuple[Session | None, str | None]:
    """Return the session, or why it cannot be read."""
    try:
        return load_session(subject.session_folder()), None
    except (ExportUnavailableError, CalibError) as error:
        return None, str(error)


def _verification(subject: Subject, session: Session | None) -> Verification | None:
    """Return what the held-out views said, or say now; None where there are none."""
    if subject.verification is not None:
        return VERIFICATION.validate_json(subject.verification)
    if session is None or all(view.use != "verify" for view in session.views):
        return None
    try:
        return verify(subject.calibration, as_solved(subject.calibration, session))
    except CalibError:
        return None


def _predicted(verification: Verification | None, calibration: Calibration) -> Iterator[Block]:
    if verification is None:
        alone = calibration.quality.held_out_by == "leave_one_view_out"
        others = "; each was predicted by the fit of all others, as the list of views says" if alone else ""
        yield Words(f"No views were held out{others}.")
        return
    kinds = list(dict.fromkeys(travel.kind for travel in verification.travel if travel.rows))
    if kinds:
        caption = (
            "How far each joint moved the camera between two held-out views: as the calibration says from the "
            "readings, less what the pictures say (the paper's method 1)"
        )
        yield Drawing(
            [Panel(figures.travel_errors(verification.travel, kind)) for kind in kinds], caption, 55
        )
    yield from paper_tables(verification, calibration)


def _residuals(subject: Subject, session: Session) -> Iterator[Block]:
    calibration, seen = subject.calibration, subject.misses
    try:
        if seen is None:
            seen = residual_map(calibration, session, observe(session))
    except CalibError as error:
        yield Words(f"Residuals by direction and by place are left out: {error}.")
        return
    if not seen:
        yield Words("Its views carried poses, and no points: the list of views says how far each is off.")
    unused = {view.view for view in calibration.quality.views if view.set_aside or view.use == "none"}
    for index, camera in enumerate(session.cameras):
        own = [
            view
            for view in seen
            if view.view not in unused and session.camera_index(session.views[view.view]) == index
        ]
        lens = calibration.cameras[calibration.camera_index(camera.name)].intrinsics
        if own and lens is not None and lens.width is not None and lens.height is not None:
            yield _residual_drawing(camera.name, own, (lens.width, lens.height))


def _residual_drawing(camera: str, views: Sequence[ViewMisses], size: tuple[int, int]) -> Drawing:
    points = sum(len(view.ids) for view in views)
    caption = (
        f"Camera '{camera}', {points} points of {len(views)} views, predicted less measured: by direction (left), and "
        "on the mean by place in the picture (right). Arrows that agree with their neighbours are a lens that is not "
        "quite so"
    )
    panels = [Panel(figures.by_direction(views), 0.8), Panel(figures.by_place(views, size), right=14.0)]
    return Drawing(panels, caption, 80)


def _remarks(calibration: Calibration) -> Iterator[Block]:
    quality = calibration.quality
    for sentence in quality.corrections:
        yield Words(f"Corrected: {sentence}.")
    for name, value in calibration.held.items():
        numbers = several(value, ".9g") if isinstance(value, list) else f"{value:.9g}"
        yield Words(f"Held, not found: {name} at {numbers}.")
    for sentence in quality.warnings:
        yield Words(f"Warning: {sentence}.")
    if not (quality.corrections or calibration.held or quality.warnings):
        yield Words("None.")


def _views(quality: Quality, session: Session | None) -> Table:
    headings = ["view", "joint", "use", "rms (px)", "position (mm)", "rotation (mrad)"]
    headings += [f"held out ({unit})" for unit in ("px", "mm", "mrad")]
    headings += ["readings"]
    rows = []
    for view in quality.views:
        readings = (
            [] if session is None or view.view >= len(session.views) else session.views[view.view].readings
        )
        rows.append(
            [
                str(view.view),
                view.joint or "several",
                "set aside"
                if view.set_aside
                else {"verify": "held out", "none": "left out"}.get(view.use, view.use),
                figure(view.rms_px),
                figure(view.position_m, 1e3),
                figure(view.rotation_rad, 1e3),
                figure(view.held_out_px),
                figure(view.held_out_position_m, 1e3),
                figure(view.held_out_rotation_rad, 1e3),
                several(readings, ".6g"),
            ]
        )
    kept = [column for column in range(len(headings)) if any(row[column] for row in rows)]
    return Table(
        "", [headings[column] for column in kept], [[row[column] for column in kept] for row in rows], 3
    )
