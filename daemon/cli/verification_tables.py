"""The verification as tables, like the paper's 1 to 4 and beside them."""

from itertools import zip_longest
from math import degrees

from rich.table import Table

from calib import paper
from calib.paper_tables import PredictionTable, TravelRow, TravelTable, prediction_tables, travel_tables
from calib.verification import Verification
from daemon.cli.console import output


def print_verification(verdict: Verification) -> None:
    """Print method 1 and method 2, each beside the paper's figures, and the verdict over all views."""
    for travel in travel_tables(verdict):
        output.print(travel_table(travel))
    for predictions in prediction_tables(verdict):
        output.print(prediction_table(predictions))
    output.print(summary(verdict), soft_wrap=True)


def travel_table(travel: TravelTable) -> Table:
    """Return method 1 of one joint: how far it moved, predicted against measured (tables 1 and 2)."""
    straight = travel.kind == "prismatic"
    unit, coarse = ("mm", "mm") if straight else ("mrad", "deg")
    theirs = (
        zip(paper.TRANSLATION_M, paper.TRANSLATION_ERROR_M, paper.TRANSLATION_PERCENT, strict=True)
        if straight
        else zip(paper.ROTATION_RAD, paper.ROTATION_ERROR_RAD, paper.ROTATION_PERCENT, strict=True)
    )
    table = Table(
        title=f"Method 1, joint '{travel.joint}': predicted against measured travel (paper: table {travel.number})",
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
            cells += [_travelled(distance, straight), *_error_cells(error, percent)]
        table.add_row(*cells)
    return table


def _travel_cells(row: TravelRow | None, straight: bool, trusted: bool) -> list[str]:
    if row is None:
        return [""] * (5 if trusted else 3)
    cells = [_travelled(row.predicted, straight), *_error_cells(row.error, row.percent)]
    if trusted:
        cells += _error_cells(row.encoder_error, row.encoder_percent)
    return cells


def _travelled(travel: float, straight: bool) -> str:
    return f"{1e3 * travel:.1f}" if straight else f"{degrees(travel):.2f}"


def _error_cells(error: float | None, percent: float | None) -> list[str]:
    """Return an error in mm or mrad, and in percent."""
    return ["" if error is None else f"{1e3 * error:.4f}", "" if percent is None else f"{percent:.4f}"]


def prediction_table(predictions: PredictionTable) -> Table:
    """Return method 2 for one joint: predicted against measured image points (tables 3 and 4)."""
    joint, number = predictions.joint, predictions.number
    theirs = paper.PREDICTION_AFTER_TRANSLATION_PX if number == 3 else paper.PREDICTION_AFTER_ROTATION_PX
    table = Table(
        title=f"Method 2, joint '{joint}': predicted against measured image points (paper: table {number})",
        title_justify="left",
    )
    for heading in ("readings", "points", "mean error (px)"):
        table.add_column(heading, justify="right")
    table.add_column("paper (px)", justify="right", style="dim")
    for row, reported in zip_longest(predictions.rows, theirs):
        reference = "" if reported is None else f"{reported:.3f}"
        if row is None:
            table.add_row("", "", "", reference)
            continue
        readings = "  ".join(f"{reading:.2f}" for reading in row.readings)
        table.add_row(readings, str(row.points), f"{row.mean_px:.3f}", reference)
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
