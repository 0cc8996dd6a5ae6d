"""The rows of the paper's tables 1 to 4, and those of our runs that belong to them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from calib import paper
from calib.session import JointKind
from calib.verification import Travel, Verification

LIKE = 0.02
"""Share by which our travel may differ from the paper's to stand in its row."""

Measure = Callable[[Travel], float | None]


@dataclass(frozen=True, slots=True)
class TravelTable:
    """Table 1 or 2: travels (m or rad) and the paper's errors."""

    number: int
    kind: JointKind
    travels: Sequence[float]
    errors: Sequence[float]


@dataclass(frozen=True, slots=True)
class PredictionTable:
    """Table 3 or 4: the paper's mean errors (px) at its positions, in their order."""

    number: int
    kind: JointKind
    errors: Sequence[float]


TRAVEL_TABLES: Final = (
    TravelTable(1, "prismatic", paper.TRANSLATION_M, paper.TRANSLATION_ERROR_M),
    TravelTable(2, "revolute", paper.ROTATION_RAD, paper.ROTATION_ERROR_RAD),
)
PREDICTION_TABLES: Final = (
    PredictionTable(3, "prismatic", paper.PREDICTION_AFTER_TRANSLATION_PX),
    PredictionTable(4, "revolute", paper.PREDICTION_AFTER_ROTATION_PX),
)


def against_encoder(travel: Travel) -> float | None:
    """Return the error as the paper has it: predicted against the encoder's own measure."""
    return None if travel.encoder is None else abs(travel.predicted - travel.encoder)


def against_pictures(travel: Travel) -> float | None:
    """Return the error against the camera poses of the pictures themselves."""
    return abs(travel.predicted - travel.measured)


def travel_errors(verdict: Verification, table: TravelTable, measure: Measure) -> dict[int, float]:
    """Return our error for each row of `table` that was travelled, by the row's place."""
    rows = [row for joint in verdict.travel if joint.kind == table.kind for row in joint.rows]
    found = {}
    for place, travel in enumerate(table.travels):
        nearest = min(rows, key=lambda row: abs(row.predicted - travel), default=None)
        error = None if nearest is None else measure(nearest)
        if nearest is not None and error is not None and abs(nearest.predicted - travel) <= LIKE * travel:
            found[place] = error
    return found


def prediction_errors(verdict: Verification, table: PredictionTable) -> dict[int, float]:
    """Return our mean error (px) at as many positions, evenly chosen from those held out, by their place."""
    joints = {joint.joint for joint in verdict.travel if joint.kind == table.kind}
    means = [view.mean_px for view in verdict.per_view if view.joint in joints and view.mean_px is not None]
    chosen = np.linspace(0, len(means) - 1, min(len(table.errors), len(means))).round().astype(int)
    return {place: means[index] for place, index in enumerate(chosen.tolist())}
