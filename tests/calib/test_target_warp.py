"""A target that is not flat: found where it was asked for and the data tell it, told of where nobody asked."""

import numpy as np
import pytest

from benchmarks import random_rigs
from benchmarks.random_rigs import looking_rig, noisy_session
from calib import solve, verify
from calib.corrections_in_words import FLAT
from calib.session import Session
from calib.targets import Chessboard, CircleGrid, target_points
from calib.warp import WARPS, possible_warps, warp_shapes

BOARD = Chessboard(rows=6, columns=7, pitch=0.03)
FLAT_POINTS = target_points(BOARD)
NOISE_FLOOR = 0.1 * np.sqrt(2)


def bulged(height: float) -> np.ndarray:
    """Return the board's points (t, 3) on a sheet that is held along edges an inch outside, its middle `height` up."""
    across, down = (FLAT_POINTS[:, 0] - 0.09) / 0.115, (FLAT_POINTS[:, 1] - 0.075) / 0.1
    points = FLAT_POINTS.copy()
    points[:, 2] = -height * (1 - across**2) * (1 - down**2)
    return points


def session(height: float, seed: int, monkeypatch: pytest.MonkeyPatch, noise: float = 0.1) -> Session:
    """Return a session of one of some rigs, whose target bulges by `height` (m)."""
    with monkeypatch.context() as patch:
        looking = looking_rig(np.random.default_rng(seed % 10), 2)
        patch.setattr(random_rigs, "POINTS", bulged(height))
        return noisy_session(looking, np.random.default_rng(seed), noise)


def out_of_plane(points: np.ndarray) -> np.ndarray:
    """Return the points' heights over their own best plane (t,), by an eigenvector of their scatter."""
    centred = points - points.mean(axis=0)
    normal = np.linalg.svd(centred)[2][2]
    return centred @ (normal * np.sign(normal[2]))


def test_a_bulge_is_found_and_predicts_better(monkeypatch: pytest.MonkeyPatch) -> None:
    taken, other = session(1.2e-3, 0, monkeypatch), session(1.2e-3, 10, monkeypatch)
    calibration = solve(taken, target_warp=True)
    warp = calibration.corrections.target_warp
    assert warp is not None
    assert warp.heights_std is not None
    true = out_of_plane(bulged(1.2e-3))
    found = out_of_plane(calibration.points_of(taken.target))
    assert np.abs(found - true).max() < 3 * max(warp.heights_std)
    assert np.corrcoef(found, true)[0, 1] > 0.99
    assert calibration.quality.rms_px == pytest.approx(NOISE_FLOOR, rel=0.05)
    assert not [sentence for sentence in calibration.quality.warnings if "from flat" in sentence]
    (sentence,) = calibration.quality.corrections
    assert sentence.startswith("the target is ")
    aware, flat = verify(calibration, other).rms_px, verify(solve(taken), other).rms_px
    assert aware is not None
    assert flat is not None
    assert aware == pytest.approx(NOISE_FLOOR, rel=0.05)
    assert flat > 1.2 * aware


def test_a_bulge_that_nobody_asked_for_is_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    calibration = solve(session(0.6e-3, 1, monkeypatch))
    assert calibration.corrections.model_dump() == {}
    (sentence,) = (sentence for sentence in calibration.quality.warnings if "from flat" in sentence)
    told = float(sentence.removeprefix("the target seems to be ").split()[0])
    assert told == pytest.approx(1e3 * np.ptp(out_of_plane(bulged(0.6e-3))), rel=0.25)


@pytest.mark.parametrize("seed", range(4))
def test_a_flat_target_stays_flat(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    taken = session(0.0, seed, monkeypatch)
    asked = solve(taken, target_warp=True)
    assert asked.corrections.model_dump() == {}
    assert asked.quality.corrections == [FLAT]
    assert not [sentence for sentence in solve(taken).quality.warnings if "from flat" in sentence]


def test_a_bulge_is_not_taken_for_an_error_of_joints(monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in (2, 3, 4):
        taken = session(0.4e-3, seed, monkeypatch)
        views = [
            view.model_copy(update={"approached": [(-1) ** i] * 2}) for i, view in enumerate(taken.views)
        ]
        assert solve(taken.with_views(views)).corrections.model_dump() == {}


def test_another_target_is_not_bent(monkeypatch: pytest.MonkeyPatch) -> None:
    calibration = solve(session(0.6e-3, 0, monkeypatch), target_warp=True)
    other = BOARD.model_copy(update={"pitch": 0.04})
    assert np.abs(calibration.points_of(BOARD)[:, 2]).max() > 1e-4
    assert (calibration.points_of(other)[:, 2] == 0).all()


def test_the_heights_covariance_is_stated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Errors of heights over rigs are as large as the stated covariance says."""
    squares = []
    for seed in range(6):
        calibration = solve(session(0.6e-3, seed, monkeypatch), target_warp=True)
        warp, covariance = calibration.corrections.target_warp, calibration.covariance
        assert warp is not None
        assert covariance is not None
        own = [i for i, name in enumerate(covariance.parameters) if "target_warp" in name]
        assert len(own) == len(warp.heights)
        shapes = warp_shapes(FLAT_POINTS, warp.shapes)
        truth = np.linalg.lstsq(shapes, out_of_plane(bulged(0.6e-3)), rcond=None)[0]
        away = np.array(warp.heights) - truth
        matrix = np.array(covariance.matrix)[np.ix_(own, own)]
        squares.append(away @ np.linalg.solve(matrix, away) / len(own))
    assert 0.4 < np.mean(squares) < 1.9


def test_the_world_stays_the_targets_mean_plane(monkeypatch: pytest.MonkeyPatch) -> None:
    points = solve(session(1e-3, 0, monkeypatch), target_warp=True).points_of(BOARD)
    plane = np.column_stack([np.ones(len(points)), points[:, :2]])
    assert np.allclose(np.linalg.lstsq(plane, points[:, 2], rcond=None)[0], 0, atol=1e-12)


@pytest.mark.parametrize("shapes", WARPS)
def test_shapes_have_no_plane_in_them_and_are_one_high(shapes: tuple[str, ...]) -> None:
    heights = warp_shapes(FLAT_POINTS, shapes)
    assert np.allclose(np.abs(heights).max(axis=0), 1)
    assert np.allclose(
        heights.T @ np.column_stack([np.ones(len(heights)), FLAT_POINTS[:, :2]]), 0, atol=1e-12
    )


def test_narrow_targets_have_fewer_shapes() -> None:
    narrow = target_points(CircleGrid(rows=2, columns=5, pitch=0.03, disk_diameter=0.01))
    assert possible_warps(narrow)[0] == ("xx", "xy")
    assert all(shape.count("y") < 2 for shapes in possible_warps(narrow) for shape in shapes)
    assert possible_warps(np.zeros((0, 3))) == []
