"""Accuracy of the calibration on the paper's simulated table beside the paper's tables 1 to 4.

The daemon's whole procedure runs in this process, pictures rendered and detected, several times with other
noise. The paper measured a real table: its figures hold what a simulation leaves out.
"""

import asyncio
from collections.abc import Mapping, Sequence
from math import degrees
from statistics import fmean

from benchmarks.paper_rows import (
    PREDICTION_TABLES,
    TRAVEL_TABLES,
    Measure,
    TravelTable,
    against_encoder,
    against_pictures,
    prediction_errors,
    travel_errors,
)
from benchmarks.paper_run import METHODS, Experiment, experiment
from benchmarks.printing import console, say, table

FIRST_SEED = 1993

OUR_COLUMNS = ("ours: mean", "min..max", "ours / paper")


def run(*, quick: bool) -> dict[str, float]:
    """Print each method's tables; return their mean ratios, and the errors against the truth (mm, mrad)."""
    seeds = range(FIRST_SEED, FIRST_SEED + (1 if quick else 5))
    runs = [asyncio.run(experiment(seed, thin=5 if quick else 1)) for seed in seeds]
    figures: dict[str, float] = {}
    for method in METHODS:
        ours = _print_method([run[method] for run in runs])
        figures |= {f"{method}, {name}": value for name, value in ours.items()}
    return figures


def _print_method(runs: Sequence[Experiment]) -> dict[str, float]:
    """Print the tables of one method over all runs; return their figures."""
    found = runs[0].calibration
    views, first = len(found.quality.views), runs[0].seed
    say(f"Method '{found.method}': {len(runs)} runs of {views} views, seeds from {first}")
    figures: dict[str, float] = {}
    for given in TRAVEL_TABLES:
        figures |= _print_travel(runs, given, "encoder", against_encoder)
        figures |= _print_travel(runs, given, "pictures", against_pictures)
    say(
        "The paper's errors are against its encoders. So are ours in the first of each two tables, which "
        "therefore hold how true the simulated encoder is: the profile chose that."
    )
    for predicted in PREDICTION_TABLES:
        errors = [prediction_errors(each.verification, predicted) for each in runs]
        title = f"Table {predicted.number}: predicted against measured image points, {predicted.kind} (px)"
        labels = [str(place + 1) for place in range(len(predicted.errors))]
        name = f"table {predicted.number}"
        figures[name] = _print_rows(title, "position", labels, predicted.errors, errors, 1.0)
    return figures | _print_truth(runs)


def _print_travel(
    runs: Sequence[Experiment], given: TravelTable, against: str, measure: Measure
) -> dict[str, float]:
    straight = given.kind == "prismatic"
    unit = "mm" if straight else "mrad"
    title = f"Table {given.number}: predicted travel against {against}, {given.kind} ({unit})"
    labels = [f"{1e3 * t:.0f} mm" if straight else f"{degrees(t):.2f} deg" for t in given.travels]
    errors = [travel_errors(each.verification, given, measure) for each in runs]
    ratio = _print_rows(title, "travel", labels, given.errors, errors, 1e3)
    return {f"table {given.number}, {against}": ratio}


def _print_rows(
    title: str,
    heading: str,
    labels: Sequence[str],
    reported: Sequence[float],
    runs: Sequence[Mapping[int, float]],
    factor: float,
) -> float:
    """Print each row's error over the runs beside the paper's, and return the mean of the rows' ratios."""
    rows = table(title, heading, "paper", *OUR_COLUMNS)
    ratios = []
    for place, (label, theirs) in enumerate(zip(labels, reported, strict=True)):
        ours = [errors[place] for errors in runs if place in errors]
        if not ours:
            rows.add_row(label, f"{factor * theirs:.4f}")
            continue
        ratios.append(fmean(ours) / theirs)
        spread = f"{factor * min(ours):.4f}..{factor * max(ours):.4f}"
        rows.add_row(
            label, f"{factor * theirs:.4f}", f"{factor * fmean(ours):.4f}", spread, f"{ratios[-1]:.3f}"
        )
    rows.add_section()
    rows.add_row("mean ratio", "", "", "", f"{fmean(ratios):.3f}")
    console.print(rows)
    return fmean(ratios)


def _print_truth(runs: Sequence[Experiment]) -> dict[str, float]:
    """Print the error of the pose itself, which no experiment on a real table can tell."""
    rows = table(
        "Camera pose against the simulated truth, anywhere in the calibrated range",
        "seed",
        "position, mean (mm)",
        "largest (mm)",
        "rotation, mean (mrad)",
        "largest (mrad)",
        "held-out points, mean (px)",
    )
    lines = [[*each.position, *each.rotation, (each.verification.mean_px or 0.0) / 1e3] for each in runs]
    for each, line in zip(runs, lines, strict=True):
        rows.add_row(str(each.seed), *(f"{1e3 * value:.4f}" for value in line))
    means = [1e3 * fmean(column) for column in zip(*lines, strict=True)]
    rows.add_section()
    rows.add_row("mean", *(f"{value:.4f}" for value in means))
    rows.add_row("min..max", *(f"{1e3 * min(c):.4f}..{1e3 * max(c):.4f}" for c in zip(*lines, strict=True)))
    console.print(rows)
    return {"position mm": means[0], "rotation mrad": means[2]}
