"""The paper's tables 1 to 4 for this rig, and what the calibration found, each with how well it is known."""

from collections.abc import Iterator
from math import degrees

import numpy as np
from numpy.typing import NDArray

from calib import Calibration
from calib.paper_tables import PredictionTable, TravelRow, TravelTable, prediction_tables, travel_tables
from calib.stated_parameters import stated_parameters
from calib.transforms import rotation_log
from calib.verification import Verification
from daemon.export.report.document import Table
from daemon.export.report.numbers import figure, known, several

Array = NDArray[np.float64]

STAND = ("x (mm)", "y (mm)", "z (mm)", "about x (deg)", "about y (deg)", "about z (deg)")
COARSE = {"m": ("mm", 1e3), "rad": ("deg", degrees(1))}
"""What metres and radians are read in."""


def paper_tables(verification: Verification, calibration: Calibration) -> Iterator[Table]:
    """Yield tables 1 and 2, then 3 and 4."""
    units = {joint.name: joint.reading_unit for joint in calibration.joints}
    for travel in travel_tables(verification, calibration):
        if travel.rows:
            yield _travel(travel, units[travel.joint])
    for prediction in prediction_tables(verification, calibration):
        yield _prediction(prediction)


def _travel(table: TravelTable, unit: str) -> Table:
    coarse, factor = COARSE["m" if table.kind == "prismatic" else "rad"]
    fine = "mm" if table.kind == "prismatic" else "mrad"
    trusted = any(row.encoder is not None for row in table.rows)
    headings = [
        f"to ({unit})",
        f"predicted ({coarse})",
        f"± ({fine})",
        f"measured ({coarse})",
        f"error ({fine})",
        "%",
    ]
    headings += [f"error to encoder ({fine})", "%"] if trusted else []

    def cells(row: TravelRow) -> list[str]:
        travels = [f"{factor * row.predicted:.4f}", figure(row.std, 1e3, 2), f"{factor * row.measured:.4f}"]
        errors = [figure(row.error, 1e3), figure(row.percent)]
        beside = [figure(row.encoder_error, 1e3), figure(row.encoder_percent)] if trusted else []
        return [f"{row.reading:.6g}", *travels, *errors, *beside]

    start = several(table.start, ".6g")
    return Table(
        f"Table {table.number}, joint '{table.joint}' from {start}: how far it moved, predicted against measured",
        headings,
        [cells(row) for row in table.rows],
        0,
    )


def _prediction(table: PredictionTable) -> Table:
    return Table(
        f"Table {table.number}, joint '{table.joint}': where points are seen, predicted against measured",
        ["readings", "points", "mean error (px)", "± of the prediction (px)"],
        [
            [several(row.readings, ".6g"), str(row.points), figure(row.mean_px), figure(row.std_px, 1, 2)]
            for row in table.rows
        ],
    )


def parameter_tables(calibration: Calibration) -> Iterator[Table]:
    """Yield a table of all parameters, then where the base and the cameras stand."""
    rows = []
    for parameter in stated_parameters(calibration):
        unit, factor = COARSE.get(parameter.unit, (parameter.unit, 1.0))
        rows.append([parameter.name, *known(parameter.value, parameter.std, factor), unit])
    yield Table("Parameters, in the world's frame, with all readings at 0", ["", "value", "±", "in"], rows)
    if calibration.joints:
        known_base = calibration.dh_covariance()
        base = None if known_base is None else known_base.base
        yield _stand("The base in the world", np.array(calibration.world_from_base), base)
    for camera in calibration.cameras:
        if camera.link_from_camera is not None:
            zero = np.zeros(len(calibration.joints))
            pose = calibration.world_from_camera(zero, camera.name)
            covariance = calibration.pose_covariance(zero, camera.name)
            yield _stand(f"Camera '{camera.name}' in the world, with all readings at 0", pose, covariance)


def _stand(title: str, pose: Array, covariance: Array | None) -> Table:
    """Return where a frame stands: its position, and its rotation vector; `covariance` (6, 6) is in its own frame."""
    place = 1e3 * pose[:3, 3]
    turn = np.degrees(rotation_log(pose[None])[0])
    rows = [["", *(f"{value:+.4f}" for value in [*place, *turn])]]
    if covariance is not None:
        std = np.sqrt(np.diag(covariance).clip(0))
        own = [*(1e3 * std[3:]), *np.degrees(std[:3])]
        rows.append(["±, in its own axes", *(figure(value, 1, 2) for value in own)])
    return Table(title, ["", *STAND], rows)
