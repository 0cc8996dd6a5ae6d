"""Where points are seen, and how sure a calibration is of it: against drawn calibrations and the truth."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from benchmarks.random_rigs import POINTS, LookingRig, looking_rig, noisy_session, project
from calib import Calibration, solve
from calib.errors import CalibError, ReadingsError
from calib.session import Session
from tests.calib.rigs import pose_session, random_rig


@cache
def calibrated() -> tuple[LookingRig, Calibration]:
    rng = np.random.default_rng(9)
    looking = looking_rig(rng, 2)
    return looking, solve(noisy_session(looking, rng))


def drawn(calibration: Calibration, count: int) -> list[Calibration]:
    """Return calibrations drawn from the stated covariance."""
    stated = calibration.covariance
    assert stated is not None
    rng, size = np.random.default_rng(2), len(stated.parameters)
    document = calibration.model_dump(mode="json")
    drawings = []
    for steps in rng.multivariate_normal(np.zeros(size), np.array(stated.matrix), size=count, tol=1e-6):
        other = Calibration.model_validate(document).model_dump(mode="json")
        for name, step in zip(stated.parameters, steps.tolist(), strict=True):
            *path, last = [int(key) if key.isdigit() else key for key in name.split(".")]
            place: Any = other
            for key in path:
                place = place[key]
            place[last] += step
        drawings.append(Calibration.model_validate(other))
    return drawings


def test_points_are_seen_where_they_were_seen() -> None:
    looking, calibration = calibrated()
    readings = looking.readings(np.random.default_rng(0), 5)
    pixels = calibration.project(POINTS, readings)
    for seen, at in zip(pixels, readings, strict=True):
        assert np.abs(seen - project(looking.rig.pose(at))).max() < 0.5
        assert np.allclose(calibration.project(POINTS, at), seen, atol=1e-9)
    behind = 2 * calibration.world_from_camera(readings[0])[:3, 3]
    assert np.isnan(calibration.project([behind], readings[0])).all()


def test_drawn_calibrations_scatter_as_stated() -> None:
    looking, calibration = calibrated()
    readings = looking.readings(np.random.default_rng(1), 3)
    points = np.vstack([POINTS[[0, 20, 41]], [[0.1, 0.05, 0.2]]])
    stated = calibration.projection_covariance(points, readings)
    assert stated is not None
    assert stated.shape == (3, 4, 2, 2)
    pixels = np.array([other.project(points, readings) for other in drawn(calibration, 1500)])
    away = pixels - calibration.project(points, readings)
    found = np.einsum("dnpi,dnpj->npij", away, away) / len(away)
    size = np.sqrt(np.einsum("npii->npi", stated))
    assert np.abs((found - stated) / (size[..., :, None] * size[..., None, :])).max() < 0.15
    single = calibration.projection_covariance(points, readings[1])
    assert single is not None
    assert np.allclose(single, stated[1])


def test_errors_are_as_large_as_stated() -> None:
    """Over rigs, held-out points are away from the truth by what is claimed, which only all correlations give."""
    distances = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        looking = looking_rig(rng, 2)
        calibration = solve(noisy_session(looking, rng))
        readings = looking.readings(rng, 10)
        away = calibration.project(POINTS, readings) - [project(looking.rig.pose(at)) for at in readings]
        covariance = calibration.projection_covariance(POINTS, readings)
        assert covariance is not None
        distances.append(
            (away * np.linalg.solve(covariance, away[..., None])[..., 0]).sum(axis=-1).mean() / 2
        )
    # Errors within a rig go together: some five independent ones a rig.
    assert np.mean(distances) == pytest.approx(1, abs=4 * np.sqrt(2 / 5 / 8))


def test_a_readings_error_of_unknown_side_counts() -> None:
    looking, calibration = calibrated()
    play = {"backlash": [{"joint": calibration.joints[1].name, "half_gap": 0.1}]}
    loose = Calibration.model_validate(calibration.model_dump(mode="json") | {"corrections": play})
    at = looking.ranges.mean(axis=1)
    sides = [loose.project(POINTS, at, approached=[0, side]) for side in (1, -1)]
    known = loose.projection_covariance(POINTS, at, approached=[0, 1])
    unknown = loose.projection_covariance(POINTS, at)
    assert known is not None
    assert unknown is not None
    half = (sides[0] - sides[1]) / 2
    assert np.allclose(unknown - known, half[:, :, None] * half[:, None], rtol=0.05, atol=1e-3)


def test_what_cannot_be_told_is_said() -> None:
    _, calibration = calibrated()
    with pytest.raises(ReadingsError, match="one finite number for each of the 2 joints"):
        calibration.project(POINTS, [1.0])
    rig = random_rig(np.random.default_rng(1), ["revolute"], [])
    poses: Session = pose_session(rig, [("j0", np.array([at]) / rig.scales) for at in (0.0, 0.5, 1.0)])
    with pytest.raises(CalibError, match="the lens of camera 'main' is not known"):
        solve(poses).project(POINTS, [0.0])
    assert calibration.model_copy(update={"covariance": None}).projection_covariance(POINTS, [0, 0]) is None
