"""`activecam solve`: from a session to a calibration."""

import json
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from calib import Calibration, load_session, save_calibration
from calib.errors import FormatError
from calib.parameters import Held
from calib.session_writer import keep_origin
from daemon.cli.console import output, progress_line, warn
from daemon.cli.quality_tables import print_quality


class Method(StrEnum):
    """How to solve."""

    ml = "ml"
    closed_form = "closed_form"


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog="Example: activecam solve sessions/monday -o monday.json")(solve)


def solve(
    session: Annotated[Path, typer.Argument(help="The session's folder, or its session.json.")],
    result: Annotated[Path, typer.Option("--output", "-o", help="Where to write the calibration.")] = Path(
        "calibration.json"
    ),
    method: Annotated[
        Method,
        typer.Option(help="The most likely calibration with its uncertainty, or the paper's closed form."),
    ] = Method.ml,
    hold: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[=VALUE]",
            help="A parameter that is kept instead of found, such as pan.scale or main.k3=0. May be repeated.",
        ),
    ] = None,
    leave_out: Annotated[
        list[int] | None,
        typer.Option(
            min=0, help="A view that is not used, by its number in the session, from 0. May be repeated."
        ),
    ] = None,
    target_warp: Annotated[
        bool, typer.Option("--target-warp", help="Let the target bulge, if the data support it.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the calibration as JSON.")] = False,
) -> None:
    """Calibrate from a session's views: chain, camera on it, base and lens, with no initial guess."""
    from calib import solve as solve_session

    if target_warp and method is Method.closed_form:
        raise typer.BadParameter(
            "--target-warp: the closed form takes every target for flat; use --method ml"
        )
    loaded = load_session(session)
    try:
        holding = loaded.holding(dict(map(_held, hold or []))).leaving_out(leave_out or [])
    except FormatError as error:
        raise typer.BadParameter(str(error)) from None
    with progress_line() as progress:
        calibration = solve_session(holding, method.value, progress, target_warp=target_warp)
    save_calibration(calibration, result)
    # A session that cannot be written to is solved all the same.
    with suppress(OSError):
        keep_origin(loaded, calibration.origin if len(calibration.joints) == len(loaded.joints) else None)
    for warning in calibration.quality.warnings:
        warn(warning)
    if as_json:
        typer.echo(json.dumps(calibration.model_dump(mode="json")))
        return
    print_calibration(calibration)
    output.print(f"Calibration written to {result}", soft_wrap=True)


def _held(text: str) -> tuple[str, Held | None]:
    """Return the parameter of `pan.scale`, `main.k3=0` or `pan.axis=0,0,1`, and what it is held at, if that is said."""
    name, said, value = text.partition("=")
    try:
        numbers = [float(number) for number in value.split(",")] if said else []
    except ValueError:
        raise typer.BadParameter(
            f"--hold {text}: '{value}' is not a number, nor three with commas between them"
        ) from None
    return name, numbers if len(numbers) > 1 else next(iter(numbers), None)


def print_calibration(calibration: Calibration) -> None:
    """Print joints, lenses and quality as tables: mm and degrees, as people read them."""
    joints = Table(title="Joints, in the world at all readings 0", title_justify="left")
    for heading in ("joint", "kind", "scale", "axis", "point (mm)"):
        joints.add_column(heading)
    for joint in calibration.joints:
        si = "m" if joint.kind == "prismatic" else "rad"
        joints.add_row(
            joint.name,
            joint.kind,
            f"{joint.scale:.9g} {si}/{joint.reading_unit}",
            "  ".join(f"{value:+.6f}" for value in joint.axis),
            "  ".join(f"{1e3 * value:+.3f}" for value in joint.point),
        )
    lenses = Table(title="Cameras", title_justify="left")
    for heading in ("camera", "rides on", "lens", "fx", "fy", "cx", "cy"):
        lenses.add_column(heading)
    for camera in calibration.cameras:
        lens = camera.intrinsics
        values = [] if lens is None else [f"{value:.2f}" for value in (lens.fx, lens.fy, lens.cx, lens.cy)]
        lenses.add_row(
            camera.name, camera.link or "nothing", "given poses" if lens is None else lens.model, *values
        )
    if calibration.joints:
        output.print(joints)
    output.print(lenses)
    if calibration.held:
        held = ", ".join(f"{name} at {_as_written(value)}" for name, value in calibration.held.items())
        output.print(f"Held, not found: {held}", soft_wrap=True)
    print_quality(calibration.quality)


def _as_written(value: Held) -> str:
    """Return a held value as `--hold` takes it."""
    return ",".join(f"{number:.9g}" for number in (value if isinstance(value, list) else [value]))
