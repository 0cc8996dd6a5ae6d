"""The rows of the paper's tables 1 to 4, and those of our runs that belong to them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from calib import paper
from calib.session import JointKind
from calib.verification import Verification

LIKE = 0.02
"""Share by which our travel may differ from the paper's to stand in its row."""


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


def travel_errors(verdict: Verification, table: TravelTable) -> dict[int, float]:
    """Return our error against the encoder for each row of `table` that was travelled, by the row's place."""
    rows = [row for joint in verdict.travel if joint.kind == table.kind for row in joint.rows]
    found = {}
    for place, travel in enumerate(table.travels):
        nearest = min(rows, key=lambda row: abs(row.predicted - travel), default=None)
        if nearest is None or nearest.encoder is None or abs(nearest.predicted - travel) > LIKE * travel:
            continue
        found[place] = abs(nearest.predicted - nearest.encoder)
    return found


def prediction_errors(verdict: Verification, table: PredictionTable) -> dict[int, float]:
    """Return our mean error (px) at as many positions, evenly chosen from those held out, by their place."""
    joints = {joint.joint for joint in verdict.travel if joint.kind == table.kind}
    means = [view.mean_px for view in verdict.per_view if view.joint in joints and view.mean_px is not None]
    chosen = np.linspace(0, len(means) - 1, min(len(table.errors), len(means))).round().astype(int)
    return {place: means[index] for place, index in enumerate(chosen.tolist())}
