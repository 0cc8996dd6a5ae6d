"""`activecam export`: a calibration as the files that others read."""

from pathlib import Path
from typing import Annotated

import typer

from calib import load_calibration
from calib.durable_files import put_in_place
from daemon.cli.console import output, progress_line, warn
from daemon.errors import ExportUnavailableError, UnknownExportError
from daemon.export import EXPORTS, Content, Subject, axes_of, export_named, make
from daemon.profile import load_profile
from daemon.profile_document import ProfileDocument

NAMES = ", ".join(export.name for export in EXPORTS)


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog="Example: activecam export calibration.json rig.urdf opencv.yaml -o monday")(export)


def export(
    calibration: Annotated[Path, typer.Argument(help="A calibration file.")],
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]...", help=f"Of {NAMES}.")] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="All that this calibration can be had as.")
    ] = False,
    folder: Annotated[Path, typer.Option("--output", "-o", help="The folder to write into.")] = Path(),
    session: Annotated[
        Path | None,
        typer.Option(
            help="The session that it was solved from; by default the folder that the calibration is in."
        ),
    ] = None,
    profile: Annotated[
        str | None,
        typer.Option(help="The rig's profile, which knows the limits: a file, or a shipped one's name."),
    ] = None,
    camera: Annotated[str | None, typer.Option(help="Whose lens, the first camera's by default.")] = None,
) -> None:
    """Write a calibration as the files that others read, beside what it was solved from where they ask for it."""
    if everything == bool(names):
        raise typer.BadParameter(f"give names, of {NAMES}, or --all")
    try:
        wanted = list(EXPORTS) if everything else [export_named(name) for name in names or []]
    except UnknownExportError as error:
        raise typer.BadParameter(str(error)) from None
    subject = _subject(calibration, session, profile)
    folder.mkdir(parents=True, exist_ok=True)
    for one in wanted:
        try:
            with progress_line() as progress:
                progress(f"making {one.name}")
                content = make(one, subject, camera)
                _write(folder / one.name, content)
        except ExportUnavailableError as error:
            if not everything:
                raise
            warn(f"{one.name} is left out: {error}")
            continue
        for note in one.notes(subject, camera):
            warn(f"{one.name}: {note}")
        output.print(f"{folder / one.name}: {one.purpose}", markup=False, soft_wrap=True)


def _subject(file: Path, session: Path | None, profile: str | None) -> Subject:
    """Return what files tell of a calibration."""
    calibration = load_calibration(file)
    described = None if profile is None else ProfileDocument.of(load_profile(profile))
    folder = session if session is not None else file.resolve().parent
    if folder.name == "session.json":
        folder = folder.parent
    return Subject(
        calibration=calibration,
        document=file.read_bytes(),
        folder=folder,
        rig=None if described is None else described.name,
        axes={} if described is None else axes_of(described.model_dump()),
    )


def _write(path: Path, content: Content) -> None:
    """Write a file whole, or leave what was there."""
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        with temporary.open("wb") as file:
            for piece in [content] if isinstance(content, bytes) else content:
                file.write(piece)
        put_in_place(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
