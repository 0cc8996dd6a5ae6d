"""How well a calibration explains its views and predicts others: by joint, by view, and the verdict."""

from collections.abc import Sequence

from rich.table import Table

from calib.stated_quality import CameraCoverage, JointQuality, Quality, ViewQuality
from daemon.cli.console import output

WORST = 5
"""How many views are shown."""

Column = tuple[str, str, float]
COLUMNS: list[Column] = [
    ("px", "{}px", 1),
    ("position (mm)", "{}position_m", 1e3),
    ("rotation (mrad)", "{}rotation_rad", 1e3),
]
"""Heading, key behind its prefix, and the factor from the key's unit to the heading's."""


def print_quality(quality: Quality) -> None:
    """Print how well each joint's views agree, the views that agree worst, what was corrected, and the verdict."""
    if quality.joints:
        output.print(joint_table(quality.joints))
    worst = worst_views(quality.views)
    if worst:
        output.print(view_table(worst))
    for covered in quality.coverage:
        output.print(coverage_line(covered), markup=False, soft_wrap=True)
    for correction in quality.corrections:
        output.print(correction, markup=False, soft_wrap=True)
    if quality.verdict is not None:
        output.print(quality.verdict, markup=False, soft_wrap=True)


def coverage_line(covered: CameraCoverage) -> str:
    """Return how the views cover a camera's picture, and what they leave out."""
    shares = (covered.x, covered.y, covered.size, covered.skew, covered.covered)
    x, y, size, skew, cells = (f"{100 * share:.0f} %" for share in shares)
    line = f"{covered.camera}: views cover X {x}, Y {y}, size {size}, skew {skew}; points in {cells} of the picture"
    return "; ".join([line, *covered.missing])


def joint_table(joints: Sequence[JointQuality]) -> Table:
    """Return a row for each joint: what the fit leaves of its views, and how they are predicted without being known."""
    table = Table(title="Views by joint", title_justify="left")
    table.add_column("joint")
    table.add_column("views", justify="right")
    columns = _add_columns(table, joints)
    for row in joints:
        table.add_row(row.joint or "several", str(row.views), *_cells(row, columns))
    return table


def worst_views(views: Sequence[ViewQuality]) -> list[ViewQuality]:
    """Return the views that agree worst, by what they were held out for where they were, the worst first."""

    def miss(view: ViewQuality) -> float:
        known = [view.held_out_px, view.rms_px, view.held_out_position_m, view.position_m]
        return next((value for value in known if value is not None), -1.0)

    return sorted((view for view in views if miss(view) >= 0), key=miss, reverse=True)[:WORST]


def view_table(views: Sequence[ViewQuality]) -> Table:
    """Return a row for each view."""
    table = Table(title="The worst views", title_justify="left")
    table.add_column("view", justify="right")
    for heading in ("joint", "use"):
        table.add_column(heading)
    columns = _add_columns(table, views)
    for row in views:
        use = "set aside" if row.set_aside else row.use
        table.add_row(str(row.view), row.joint or "several", use, *_cells(row, columns))
    return table


def _add_columns(table: Table, rows: Sequence[JointQuality | ViewQuality]) -> list[tuple[str, float]]:
    """Add a column for everything that some row has a measure of; return its key and factor."""
    columns = []
    for what, prefix in (("error", ""), ("held out", "held_out_")):
        for unit, key, factor in COLUMNS:
            name = "rms_px" if key.format(prefix) == "px" else key.format(prefix)
            if any(getattr(row, name) is not None for row in rows):
                table.add_column(f"{what}, {unit}", justify="right")
                columns.append((name, factor))
    return columns


def _cells(row: JointQuality | ViewQuality, columns: Sequence[tuple[str, float]]) -> list[str]:
    values = [(getattr(row, name), factor) for name, factor in columns]
    return ["" if value is None else f"{factor * value:.3f}" for value, factor in values]
