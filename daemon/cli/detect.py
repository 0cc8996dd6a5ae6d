"""`activecam detect`: what is seen of the target in pictures, and how good they are."""

import json
from dataclasses import asdict
from math import degrees
from pathlib import Path
from typing import Annotated, Any

import typer

from calib import load_calibration
from calib.detection import Detection, Inspection, PictureHealth, Prediction, inspect
from calib.errors import ImageError, UnsolvableError
from calib.picture_file import load_picture
from calib.targets import Target
from daemon.cli.console import output, progress_line
from daemon.cli.pose import Readings, ReadingsFile, wanted_readings
from daemon.profile import load_target


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog="Example: activecam detect live.jpg --profile my-rig.toml")(detect)


def detect(
    pictures: Annotated[list[Path], typer.Argument(metavar="PICTURE...", help="Pictures of the target.")],
    profile: Annotated[
        str,
        typer.Option(
            help="The rig's profile: a file, or a shipped one's name; or a file with its [target] alone."
        ),
    ],
    calibration: Annotated[
        Path | None,
        typer.Option(help="A calibration that says where the target is in pictures taken at known readings."),
    ] = None,
    readings: Readings = None,
    readings_file: ReadingsFile = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print all points and figures as JSON.")] = False,
) -> int:
    """Look for the target in pictures, and say how good they are, one by one and together."""
    from calib.coverage import coverage, missing_in_words

    target = load_target(profile)
    predicted = _predicted(target, calibration, readings, readings_file, len(pictures))
    looks: list[Inspection] = []
    with progress_line() as progress:
        for number, (path, where) in enumerate(zip(pictures, predicted, strict=True), start=1):
            progress(f"looking at picture {number} of {len(pictures)}")
            looks.append(_look(path, target, where))
    seen = [look for look in looks if look.detection is not None]
    # Pictures of one camera: those of another size are not, and count for themselves.
    sizes = {(look.health.width, look.health.height) for look in seen if look.health is not None}
    covered = None
    if len(seen) > 1 and len(sizes) == 1:
        covered = coverage(target, sizes.pop(), [look.detection for look in seen if look.detection])
    missing = [] if covered is None else missing_in_words(covered)
    if as_json:
        together = None if covered is None else {**asdict(covered), "missing": missing}
        documents = [_document(path, look) for path, look in zip(pictures, looks, strict=True)]
        typer.echo(json.dumps({"pictures": documents, "coverage": together}))
    else:
        for path, look in zip(pictures, looks, strict=True):
            output.print(_in_words(path, look), markup=False, soft_wrap=True)
        for sentence in missing:
            output.print(f"together: {sentence}", markup=False, soft_wrap=True)
    return 0 if len(seen) == len(looks) else 1


def _predicted(
    target: Target,
    calibration: Path | None,
    readings: list[float] | None,
    readings_file: Path | None,
    count: int,
) -> list[Prediction | None]:
    """Return where each of `count` pictures should show the target, as far as that is known."""
    if calibration is None:
        if readings is not None or readings_file is not None:
            raise typer.BadParameter("readings tell where the target is with --calibration only")
        return [None] * count
    from calib.prediction import predicted_by_calibration

    loaded = load_calibration(calibration)
    wanted = wanted_readings(readings, readings_file, [joint.name for joint in loaded.joints])
    if len(wanted) != count:
        raise typer.BadParameter(f"there are readings for {len(wanted)} pictures, and {count} pictures")
    predicted: list[Prediction | None] = []
    for at in wanted:
        try:
            predicted.append(predicted_by_calibration(loaded, target, at))
        except UnsolvableError:
            predicted.append(None)
    return predicted


def _look(path: Path, target: Target, predicted: Prediction | None) -> Inspection:
    try:
        return inspect(load_picture(path), target, predicted)
    except ImageError as error:
        # One bad file of many does not keep the others from being looked at.
        return Inspection(None, str(error).removeprefix(f"{path}: "), None, ())


def _document(path: Path, look: Inspection) -> dict[str, Any]:
    found = look.detection
    return {
        "file": str(path),
        "found": found is not None,
        "problem": look.problem,
        "ids": [] if found is None else found.ids.tolist(),
        "pixels": [] if found is None else found.pixels.tolist(),
        "health": None if look.health is None else asdict(look.health),
        "faults": [asdict(fault) for fault in look.faults],
    }


def _in_words(path: Path, look: Inspection) -> str:
    if look.detection is None or look.health is None:
        return f"{path}: {look.problem}"
    lines = [f"{path}: {_figures(look.detection, look.health)}"]
    return "\n  ".join(lines + [fault.message for fault in look.faults])


def _figures(detection: Detection, health: PictureHealth) -> str:
    target, edges = health.target, health.edges
    assert target is not None  # it was found
    figures = [f"{len(detection.ids)} of {target.of} points"]
    if edges is not None:
        figures.append(f"edges {edges.narrowest_px:.1f} to {edges.widest_px:.1f} px wide")
    if target.element_px is not None:
        figures.append(f"{target.element} {target.element_px:.0f} px")
    if target.tilt is not None:
        figures.append(f"leaning {degrees(target.tilt):.0f} deg")
    return ", ".join(figures)
