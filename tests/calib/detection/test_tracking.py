"""Points measured where they are predicted; of a wrong prediction come the right points or none."""

from functools import lru_cache

import numpy as np
import pytest
from drawn_targets import Drawn, draw, project

from calib.detection import Prediction, detect, track
from calib.errors import DetectionError
from calib.targets import (
    AprilGrid,
    AsymmetricCircleGrid,
    Charuco,
    Chessboard,
    CircleGrid,
    disk_diameter,
    target_points,
    target_symmetries,
)

GRIDS = [
    CircleGrid(rows=6, columns=7, pitch=0.03, disk_diameter=0.018),
    AsymmetricCircleGrid(rows=7, columns=4, pitch=0.04, disk_diameter=0.016),
    Chessboard(rows=6, columns=9, pitch=0.025),
]
NUMBERED = [
    Charuco(rows=5, columns=7, pitch=0.03, marker=0.021, dictionary="DICT_5X5_100"),
    AprilGrid(rows=4, columns=5, tag=0.03, spacing=0.009),
]
ALL = GRIDS + NUMBERED
SYMMETRIC = [
    GRIDS[0],
    CircleGrid(rows=5, columns=5, pitch=0.03, disk_diameter=0.018),
    AsymmetricCircleGrid(rows=6, columns=4, pitch=0.04, disk_diameter=0.016),
    Chessboard(rows=5, columns=7, pitch=0.025),
]
USUAL = {"tilt": (20, 10), "noise": 1, "size": (800, 600)}
RIGHT = 0.25  # px

drawn_once = lru_cache(draw)


def usual(target, **other) -> Drawn:
    return drawn_once(target, **{**USUAL, **other})


def truth_of(drawn: Drawn, target) -> np.ndarray:
    return drawn.disk_centroids(target) if disk_diameter(target) else drawn.points


def expected(pixels: np.ndarray, off: float = 3.0) -> Prediction:
    return Prediction(np.arange(len(pixels)), pixels, off)


def right_or_none(picture, target, predicted, *truths) -> int:
    """Return how many points were tracked; all are where one of the truths has them, and the same one."""
    try:
        detection = track(picture, target, predicted)
    except DetectionError:
        return 0
    misses = [np.linalg.norm(detection.pixels - truth[detection.ids], axis=1).max() for truth in truths]
    assert min(misses) < RIGHT
    return len(detection.ids)


@pytest.mark.parametrize("target", ALL, ids=lambda target: target.kind)
@pytest.mark.parametrize("motion", [(0, 0), (3, -2), (-8, 11)], ids=str)
def test_a_target_is_tracked_from_where_it_was(target, motion):
    before, now = usual(target), usual(target, shift=motion)
    predicted = Prediction.of(detect(before.picture, target), off=15)
    detection = track(now.picture, target, predicted)
    truth = truth_of(now, target)
    assert list(detection.ids) == list(range(len(truth)))
    # What looks the same after a turn is read as it was before.
    readings = [truth, *(truth[symmetry.permutation] for symmetry in target_symmetries(target))]
    errors = min((detection.pixels - reading for reading in readings), key=lambda e: np.abs(e).max())
    assert np.sqrt(np.mean(errors**2)) < 0.06


SHIFTS = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (2, 0), (0, -2), (0.5, 0), (0, 0.5), (0.5, 0.5)]


def moved_in_plane(drawn: Drawn, target, steps: tuple[float, float]) -> np.ndarray:
    """Project the target's points, so many pitches off along its columns and rows."""
    return project(drawn.picture_from_world, target_points(target)[:, :2] + np.array(steps) * target.pitch)


@pytest.mark.parametrize("target", ALL, ids=lambda target: target.kind)
@pytest.mark.parametrize("steps", SHIFTS, ids=str)
def test_a_prediction_off_by_a_pitch_or_half_of_one_gives_no_wrong_points(target, steps):
    drawn = usual(target)
    predicted = expected(moved_in_plane(drawn, target, steps), 20.0)
    right_or_none(drawn.picture, target, predicted, truth_of(drawn, target))


@pytest.mark.parametrize("target", ALL, ids=lambda target: target.kind)
@pytest.mark.parametrize("shift", [(250, 0), (-280, -150), (0, 250), (-420, 0)], ids=str)
def test_what_is_in_the_picture_of_half_a_target_is_tracked(target, shift):
    drawn = usual(target, fill=0.8, shift=shift)
    truth = truth_of(drawn, target)
    spacing = np.linalg.norm(truth[1] - truth[0])
    found = right_or_none(drawn.picture, target, expected(truth + 2), truth)
    well_inside = ((truth > spacing) & (truth < [799 - spacing, 599 - spacing])).all(axis=1)
    assert found >= 0.8 * well_inside.sum()


@pytest.mark.parametrize("target", ALL, ids=lambda target: target.kind)
@pytest.mark.parametrize("shift", [(250, 0), (-280, -150), (0, 250), (-420, 0)], ids=str)
@pytest.mark.parametrize("steps", SHIFTS, ids=str)
def test_half_a_target_is_not_taken_for_its_other_half(target, shift, steps):
    drawn = usual(target, fill=0.8, shift=shift)
    predicted = expected(moved_in_plane(drawn, target, steps), 5.0)
    right_or_none(drawn.picture, target, predicted, truth_of(drawn, target))


@pytest.mark.parametrize("target", SYMMETRIC, ids=lambda target: f"{target.kind} {target.rows}")
def test_a_target_that_looks_the_same_after_a_turn_is_read_as_predicted(target):
    drawn = usual(target)
    truth = truth_of(drawn, target)
    for symmetry in target_symmetries(target):
        turned = truth[symmetry.permutation]
        found = right_or_none(drawn.picture, target, expected(turned + 1), turned)
        assert found == len(truth)


@pytest.mark.parametrize("target", ALL, ids=lambda target: target.kind)
def test_a_prediction_turned_half_way_round_is_right_or_refused(target):
    drawn = usual(target)
    truth = truth_of(drawn, target)
    turned = truth.min(axis=0) + truth.max(axis=0) - truth
    readings = [truth, *(truth[symmetry.permutation] for symmetry in target_symmetries(target))]
    right_or_none(drawn.picture, target, expected(turned, 20.0), *readings)
