"""The verification as tables, like the paper's 1 to 4 and beside them."""

from itertools import zip_longest
from math import degrees

import numpy as np
from rich.table import Table

from calib import paper
from calib.verification import JointTravel, Travel, Verification, ViewVerdict
from daemon.cli.console import output

POSITIONS = 5
"""How many positions tables 3 and 4 have."""


def print_verification(verdict: Verification) -> None:
    """Print method 1 and method 2, each beside the paper's figures, and the verdict over all views."""
    for travel in verdict.travel:
        output.print(travel_table(travel))
    for joint in dict.fromkeys(travel.joint for travel in verdict.travel):
        kind = next(travel.kind for travel in verdict.travel if travel.joint == joint)
        seen = [view for view in verdict.per_view if view.joint == joint and view.mean_px is not None]
        if seen:
            output.print(prediction_table(joint, kind, seen))
    output.print(summary(verdict), soft_wrap=True)


def travel_table(travel: JointTravel) -> Table:
    """Return method 1 of one joint: how far it moved, predicted against measured (tables 1 and 2)."""
    straight = travel.kind == "prismatic"
    unit, coarse = ("mm", "mm") if straight else ("mrad", "deg")
    theirs = (
        zip(paper.TRANSLATION_M, paper.TRANSLATION_ERROR_M, paper.TRANSLATION_PERCENT, strict=True)
        if straight
        else zip(paper.ROTATION_RAD, paper.ROTATION_ERROR_RAD, paper.ROTATION_PERCENT, strict=True)
    )
    number = 1 if straight else 2
    table = Table(
        title=f"Method 1, joint '{travel.joint}': predicted against measured travel (paper: table {number})",
        title_justify="left",
    )
    trusted = any(row.encoder is not None for row in travel.rows)
    table.add_column(f"travel ({coarse})", justify="right")
    table.add_column(f"error to pictures ({unit})", justify="right")
    table.add_column("%", justify="right")
    if trusted:
        table.add_column(f"error to encoder ({unit})", justify="right")
        table.add_column("%", justify="right")
    table.add_column(f"paper: travel ({coarse})", justify="right", style="dim")
    table.add_column(f"error ({unit})", justify="right", style="dim")
    table.add_column("%", justify="right", style="dim")
    for row, reported in zip_longest(travel.rows, theirs):
        cells = _travel_cells(row, straight, trusted)
        if reported is not None:
            distance, error, percent = reported
            cells += [_travelled(distance, straight), f"{1e3 * error:.4f}", f"{percent:.4f}"]
        table.add_row(*cells)
    return table


def _travel_cells(row: Travel | None, straight: bool, trusted: bool) -> list[str]:
    if row is None:
        return [""] * (5 if trusted else 3)
    cells = [_travelled(row.predicted, straight), *_error_cells(row.predicted, row.measured)]
    if trusted:
        cells += ["", ""] if row.encoder is None else _error_cells(row.predicted, row.encoder)
    return cells


def _travelled(travel: float, straight: bool) -> str:
    return f"{1e3 * travel:.1f}" if straight else f"{degrees(travel):.2f}"


def _error_cells(predicted: float, measured: float) -> list[str]:
    """Return the error in mm or mrad, and in percent."""
    error = abs(predicted - measured)
    return [f"{1e3 * error:.4f}", f"{100 * error / abs(measured):.4f}" if measured else ""]


def prediction_table(joint: str, kind: str, views: list[ViewVerdict]) -> Table:
    """Return method 2 for one joint: predicted against measured image points (tables 3 and 4)."""
    number = 3 if kind == "prismatic" else 4
    theirs = paper.PREDICTION_AFTER_TRANSLATION_PX if number == 3 else paper.PREDICTION_AFTER_ROTATION_PX
    table = Table(
        title=f"Method 2, joint '{joint}': predicted against measured image points (paper: table {number})",
        title_justify="left",
    )
    for heading in ("readings", "points", "mean error (px)"):
        table.add_column(heading, justify="right")
    table.add_column("paper (px)", justify="right", style="dim")
    chosen = np.unique(np.linspace(0, len(views) - 1, min(POSITIONS, len(views))).round().astype(int))
    for index, reported in zip_longest(chosen, theirs):
        reference = "" if reported is None else f"{reported:.3f}"
        if index is None:
            table.add_row("", "", "", reference)
            continue
        view = views[int(index)]
        readings = "  ".join(f"{reading:.2f}" for reading in view.readings)
        table.add_row(readings, str(view.points), f"{view.mean_px:.3f}", reference)
    return table


def summary(verdict: Verification) -> str:
    """Return the verdict over all views in one sentence."""
    parts = []
    if verdict.mean_px is not None:
        parts.append(
            f"points {verdict.mean_px:.3f} px mean, {verdict.rms_px:.3f} px rms, {verdict.max_px:.3f} px max"
        )
    if verdict.position_m is not None:
        position = verdict.position_m
        parts.append(f"position {1e3 * position.mean:.3f} mm mean, {1e3 * position.max:.3f} mm max")
    if verdict.rotation_rad is not None:
        rotation = verdict.rotation_rad
        parts.append(f"rotation {1e3 * rotation.mean:.3f} mrad mean, {1e3 * rotation.max:.3f} mrad max")
    return f"Prediction of {verdict.views} views: {'; '.join(parts)}"
