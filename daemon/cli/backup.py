"""`activecam backup` and `activecam restore`: a data folder as one file, and back."""

from pathlib import Path
from typing import Annotated

import typer

from daemon.backup import make_backup, restore_backup
from daemon.cli.console import output

DATA = Path("activecam-data")


def register(app: typer.Typer) -> None:
    """Add the commands to `app`."""
    app.command(epilog="Example: activecam backup monday.zip --data /var/lib/activecam")(backup)
    app.command(epilog="Example: activecam restore monday.zip --data /var/lib/activecam")(restore)


def backup(
    file: Annotated[Path, typer.Argument(help="Where to write the backup, a ZIP file.")],
    data: Annotated[Path, typer.Option(help="The data folder; a daemon may be using it.")] = DATA,
) -> None:
    """Write all runs, sessions and calibrations into one file, and read it again to see that they are there."""
    count = make_backup(data, file)
    output.print(f"{count} files of {data} are in {file}, and were found there in order", soft_wrap=True)


def restore(
    file: Annotated[Path, typer.Argument(help="A backup.")],
    data: Annotated[Path, typer.Option(help="The data folder; no daemon may be using it.")] = DATA,
    force: Annotated[bool, typer.Option("--force", help="Move aside what is in the data folder.")] = False,
) -> None:
    """Put what is in a backup into a data folder: all of it, or nothing."""
    aside = restore_backup(file, data, move_aside=force)
    if aside is not None:
        output.print(f"What was in {data} is in {aside}", soft_wrap=True)
    output.print(f"{file} is restored to {data}", soft_wrap=True)
