"""The paper's tables 1 to 4 for another rig: its two verifications, joint by joint, with how sure the calibration is.

Tables 1 and 2 compare how far a straight and a turning joint moved, as predicted from the readings, with the pictures
and, where its unit is trusted, with the encoder. Tables 3 and 4 compare image points after such a motion with where
they are predicted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from calib.calibration import Calibration
from calib.session import JointKind
from calib.targets import target_points

if TYPE_CHECKING:  # a daemon that only serves poses does without the solver that it brings
    from calib.verification import JointTravel, Travel, Verification, ViewVerdict

POSITIONS = 5
"""How many positions tables 3 and 4 have."""


@dataclass(frozen=True)
class TravelRow:
    """A travel (m or rad), with the error of its prediction, and of that in percent of what was measured.

    `std` is how sure the calibration is of what it predicts; None where it does not know. The encoder's are None where
    its unit is not trusted.
    """

    reading: float
    predicted: float
    std: float | None
    measured: float
    error: float
    percent: float | None
    encoder: float | None
    encoder_error: float | None
    encoder_percent: float | None


@dataclass(frozen=True)
class TravelTable:
    """Table 1, of a straight joint, or 2, of a turning one, from `start` (readings)."""

    number: int
    joint: str
    kind: JointKind
    start: list[float]
    rows: list[TravelRow]


@dataclass(frozen=True)
class PredictionRow:
    """A view: how far its points are from where they are predicted (px, mean).

    `std_px` is how sure the calibration is of where it predicts them (rms); None where it does not know.
    """

    view: int
    readings: list[float]
    points: int
    mean_px: float
    std_px: float | None


@dataclass(frozen=True)
class PredictionTable:
    """Table 3, of a straight joint, or 4, of a turning one."""

    number: int
    joint: str
    kind: JointKind
    rows: list[PredictionRow]


def travel_tables(verification: Verification, calibration: Calibration | None = None) -> list[TravelTable]:
    """Return tables 1 and 2: one for each joint and start that the verification has views of."""
    stds = {} if calibration is None else {joint.name: joint.scale_std for joint in calibration.joints}
    return [
        TravelTable(
            number=1 if travel.kind == "prismatic" else 2,
            joint=travel.joint,
            kind=travel.kind,
            start=travel.start,
            rows=[_travel(row, travel, stds.get(travel.joint), calibration) for row in travel.rows],
        )
        for travel in verification.travel
    ]


def _travel(
    row: Travel, travel: JointTravel, scale_std: float | None, calibration: Calibration | None
) -> TravelRow:
    error, percent = _error(row.predicted, row.measured)
    encoder_error, encoder_percent = (
        (None, None) if row.encoder is None else _error(row.predicted, row.encoder)
    )
    std = None
    if scale_std is not None and calibration is not None:
        index = [joint.name for joint in calibration.joints].index(travel.joint)
        std = scale_std * abs(row.reading - travel.start[index])
    return TravelRow(
        reading=row.reading,
        predicted=row.predicted,
        std=std,
        measured=row.measured,
        error=error,
        percent=percent,
        encoder=row.encoder,
        encoder_error=encoder_error,
        encoder_percent=encoder_percent,
    )


def _error(predicted: float, measured: float) -> tuple[float, float | None]:
    """Return the error, and what it is in percent."""
    error = abs(predicted - measured)
    return error, 100 * error / abs(measured) if measured else None


def prediction_tables(
    verification: Verification, calibration: Calibration | None = None
) -> list[PredictionTable]:
    """Return tables 3 and 4: one for each joint that moved alone, at positions evenly among its views."""
    kinds = {travel.joint: travel.kind for travel in verification.travel}
    tables = []
    for joint, kind in kinds.items():
        seen = [view for view in verification.per_view if view.joint == joint and view.mean_px is not None]
        if seen:
            rows = _predictions(_spread(seen), calibration)
            tables.append(PredictionTable(3 if kind == "prismatic" else 4, joint, kind, rows))
    return tables


def _spread(views: Sequence[ViewVerdict]) -> list[ViewVerdict]:
    places = np.linspace(0, len(views) - 1, min(POSITIONS, len(views))).round().astype(int)
    return [views[place] for place in np.unique(places).tolist()]


def _predictions(views: Sequence[ViewVerdict], calibration: Calibration | None) -> list[PredictionRow]:
    stds = _prediction_stds(views, calibration)
    return [
        PredictionRow(view.view, view.readings, view.points, view.mean_px, std)
        for view, std in zip(views, stds, strict=True)
        if view.mean_px is not None
    ]


def _prediction_stds(views: Sequence[ViewVerdict], calibration: Calibration | None) -> Sequence[float | None]:
    """Return how sure the calibration is of where it predicts the target's points (px, rms), by view."""
    unknown = [None] * len(views)
    if calibration is None or calibration.target is None or calibration.cameras[0].intrinsics is None:
        return unknown
    points = target_points(calibration.target)
    known = calibration.projection_covariance(points, [view.readings for view in views])
    if known is None:
        return unknown
    stds: list[float | None] = np.sqrt(np.trace(known, axis1=2, axis2=3).mean(axis=1)).tolist()
    return stds
