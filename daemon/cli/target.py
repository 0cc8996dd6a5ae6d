"""`activecam target`: a target to print."""

from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from calib.targets import Target
from daemon.printing import Paper, lay_out, parse_paper, pdf, png, svg
from daemon.profile import load_profile
from daemon.profile.sentences import sentence
from daemon.profile.targets import TargetTable, resolve_target, target_table
from drivers.quantities import LENGTH, parse_quantity

DPI = 300.0
ENDINGS = (".pdf", ".svg", ".png")


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(
        epilog="Example: activecam target --kind charuco --rows 7 --columns 5 --pitch '30 mm' --marker '22 mm' "
        "--dictionary DICT_5X5_100 -o target.pdf"
    )(target)


def target(
    result: Annotated[
        Path,
        typer.Option("--output", "-o", help="The file to write: its ending, .pdf, .svg or .png, says what."),
    ] = Path("target.pdf"),
    like: Annotated[
        str | None,
        typer.Option(metavar="PROFILE", help="Draw the target of a profile: a file or a shipped one's name."),
    ] = None,
    kind: Annotated[
        str | None,
        typer.Option(help="circle_grid, asymmetric_circle_grid, chessboard, charuco or aprilgrid."),
    ] = None,
    rows: Annotated[
        int | None, typer.Option(help="How many: of disks, inner corners, squares (charuco) or tags.")
    ] = None,
    columns: Annotated[int | None, typer.Option(help="How many a row.")] = None,
    pitch: Annotated[
        str | None, typer.Option(help="From one disk or square to the next, such as '30 mm'.")
    ] = None,
    disk_diameter: Annotated[str | None, typer.Option(help="Of circle grids.")] = None,
    marker: Annotated[str | None, typer.Option(help="Side of a ChArUco board's markers.")] = None,
    tag: Annotated[str | None, typer.Option(help="Side of an AprilGrid's tags.")] = None,
    spacing: Annotated[str | None, typer.Option(help="White between an AprilGrid's tags.")] = None,
    dictionary: Annotated[
        str | None, typer.Option(help="The markers' or tags', by OpenCV's name, such as DICT_5X5_100.")
    ] = None,
    paper: Annotated[
        str, typer.Option(help="A4, Letter, A3, A2, A1, A0, or a size such as '300x400 mm'.")
    ] = "A4",
    margin: Annotated[str, typer.Option(help="What the printer cannot print on.")] = "10 mm",
    dpi: Annotated[
        float | None, typer.Option(min=1, help="Pixels an inch of a PNG; 300 by default.", show_default=False)
    ] = None,
) -> None:
    """Draw a target true to scale, with rulers to check the print, and print the profile's [target] for it."""
    given = {
        "kind": kind,
        "rows": rows,
        "columns": columns,
        "pitch": pitch,
        "disk_diameter": disk_diameter,
        "marker": marker,
        "tag": tag,
        "spacing": spacing,
        "dictionary": dictionary,
    }
    given = {name: value for name, value in given.items() if value is not None}
    if (like is None) == (not given):
        raise typer.BadParameter("give either --like PROFILE, or --kind and the target's own options")
    ending = result.suffix.lower()
    if ending not in ENDINGS:
        raise typer.BadParameter(f"--output {result}: its ending must be one of {', '.join(ENDINGS)}")
    if dpi is not None and ending != ".png":
        raise typer.BadParameter(f"--dpi is for a PNG, and {result} has no pixels")

    sheet_paper, sheet_margin = _paper(paper), _margin(margin)
    chosen = load_profile(like).target if like is not None else _described(given)
    sheet = lay_out(chosen, sheet_paper, sheet_margin)
    match ending:
        case ".pdf":
            file = pdf(sheet)
        case ".svg":
            file = svg(sheet)
        case _:
            file = png(sheet, dpi or DPI)
    result.write_bytes(file)
    typer.echo(f"# As drawn in {result}. Measure the print, and write what you measured.")
    typer.echo(target_table(chosen), nl=False)


def _paper(text: str) -> Paper:
    try:
        return parse_paper(text)
    except ValueError as error:
        raise typer.BadParameter(f"--paper: {error}") from None


def _margin(text: str) -> float:
    try:
        margin = parse_quantity(text, LENGTH)
    except ValueError as error:
        raise typer.BadParameter(f"--margin: {error}") from None
    if margin < 0:
        raise typer.BadParameter("--margin must not be negative")
    return margin


def _described(given: dict[str, Any]) -> Target:
    """Return the target that the options describe; raises BadParameter with all that is wrong with them."""
    try:
        return resolve_target(TypeAdapter(TargetTable).validate_python(given))
    except ValidationError as error:
        problems = [_problem(details, given) for details in error.errors(include_url=False)]
        raise typer.BadParameter("; ".join(problems)) from None


def _problem(details: ErrorDetails, given: dict[str, Any]) -> str:
    """Say what is wrong with an option."""
    if details["type"] == "union_tag_not_found":
        return "--kind is missing"
    if details["type"] == "union_tag_invalid":
        return f"--kind must be one of {details['ctx']['expected_tags']}, not '{given['kind']}'"
    _, *keys = details["loc"]
    if not keys:
        return sentence(details)
    option = f"--{str(keys[0]).replace('_', '-')}"
    match details["type"]:
        case "missing":
            return f"{option} is missing"
        case "extra_forbidden":
            return f"{option} is not for a target of the kind {given['kind']}"
        case _:
            return f"{option}: {sentence(details)}"
