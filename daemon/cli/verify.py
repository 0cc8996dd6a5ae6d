"""`activecam verify`: the paper's two verifications on views that the calibration has not seen."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from calib import load_calibration, load_session
from daemon.cli.console import progress_line, warn


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog="Example: activecam verify calibration.json sessions/tuesday")(verify)


def verify(
    calibration: Annotated[Path, typer.Argument(help="A calibration file.")],
    session: Annotated[Path, typer.Argument(help="A session of the same rig: its held-out views, or all.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the verdict as JSON.")] = False,
) -> None:
    """Judge a calibration on other views: predicted against measured travel, image points and poses."""
    from calib import verify as verify_session
    from daemon.cli.verification_tables import print_verification

    loaded, views = load_calibration(calibration), load_session(session)
    with progress_line() as progress:
        verdict = verify_session(loaded, views, progress)
    for warning in verdict.warnings:
        warn(warning)
    if as_json:
        typer.echo(json.dumps(asdict(verdict)))
    else:
        print_verification(verdict)
