"""Points measured where they are predicted; of a wrong prediction come the right points or none."""

from functools import lru_cache

import cv2
import numpy as np
import pytest
from drawn_targets import WALL, Drawn, draw, project
from hypothesis import example, given, settings
from hypothesis import strategies as st

from calib.detection import Prediction, detect, track
from calib.errors import DetectionError
from calib.targets import (
    AprilGrid,
    AsymmetricCircleGrid,
    Charuco,
    Chessboard,
    CircleGrid,
    NoTarget,
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
RIGHT = 0.35  # px

drawn_once = lru_cache(draw)


def usual(target, **other) -> Drawn:
    return drawn_once(target, **{**USUAL, **other})


def truth_of(drawn: Drawn, target) -> np.ndarray:
    return drawn.disk_centroids(target) if disk_diameter(target) else drawn.points


def expected(pixels: np.ndarray, off: float = 3.0) -> Prediction:
    return Prediction(np.arange(len(pixels)), pixels, off)


def right_or_none(picture, target, predicted, *truths, right=RIGHT) -> int:
    """Return how many points were tracked; all are where one and the same truth has them, to `right` px."""
    try:
        detection = track(picture, target, predicted)
    except DetectionError:
        return 0
    misses = [np.linalg.norm(detection.pixels - truth[detection.ids], axis=1).max() for truth in truths]
    assert min(misses) < right
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


@pytest.mark.parametrize("target", ALL, ids=lambda target: target.kind)
@pytest.mark.parametrize("other", ALL, ids=lambda target: target.kind)
def test_another_target_is_not_taken_for_the_predicted_one(target, other):
    if target is other:
        other = target.model_copy(update={"rows": target.rows + 1})
    truth = truth_of(usual(target), target)
    assert right_or_none(usual(other).picture, target, expected(truth, 20.0), truth + 1e6) == 0


@pytest.mark.parametrize("target", ALL, ids=lambda target: target.kind)
def test_of_two_targets_side_by_side_each_is_tracked_by_its_own_prediction(target):
    pair = [
        drawn_once(target, size=(500, 500), tilt=(20, 10), fill=0.6, noise=1, roll=roll) for roll in (0, 4)
    ]
    picture = np.hstack([drawn.picture for drawn in pair])
    truths = [truth_of(pair[0], target), truth_of(pair[1], target) + np.array([500, 0])]
    for truth in truths:
        assert right_or_none(picture, target, expected(truth - 2, 10.0), truth) == len(truth)
    between = (truths[0] + truths[1]) / 2
    right_or_none(picture, target, expected(between, 20.0), *truths)


@pytest.mark.parametrize("target", ALL, ids=lambda target: target.kind)
@pytest.mark.parametrize("noise", [0.0, 20.0])
def test_an_empty_picture_has_no_target(target, noise):
    truth = truth_of(usual(target), target)
    wall = WALL + noise * np.random.default_rng(2).standard_normal((600, 800))
    with pytest.raises(DetectionError, match="is not where it was predicted to within 20 px"):
        track(np.clip(wall, 0, 255).astype(np.uint8), target, expected(truth, 20.0))


HANDS = {
    "white": np.full((600, 800), 225.0),
    "black": np.full((600, 800), 25.0),
    "shaded": np.tile(np.linspace(20.0, 230.0, 800), (600, 1)),
}


@pytest.mark.parametrize("target", ALL, ids=lambda target: target.kind)
@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("side", ["left", "right", "lower", "middle"])
def test_a_hand_before_the_target_takes_points_away_and_moves_none(target, hand, side):
    drawn = usual(target)
    truth = truth_of(drawn, target)
    (left, top), (right, bottom) = truth.min(axis=0), truth.max(axis=0)
    x, y = np.meshgrid(np.arange(800), np.arange(600))
    covered = {
        "left": x < left + 0.4 * (right - left),
        "right": x > left + 0.55 * (right - left),
        "lower": y > top + 0.5 * (bottom - top),
        "middle": np.hypot(x - (left + right) / 2, y - (top + bottom) / 2) < 0.3 * (bottom - top),
    }[side]
    picture = np.where(covered, HANDS[hand], drawn.picture).astype(np.uint8)
    found = right_or_none(picture, target, expected(truth + 2), truth)
    free = ~covered[tuple(np.rint(truth).astype(int).T[::-1])]
    # A tag's corner is where its sides cross, seen or not.
    assert found <= free.sum() + (2 if isinstance(target, AprilGrid) else 0)
    if side == "middle":
        assert found >= 0.6 * free.sum()
    for steps in SHIFTS:
        predicted = expected(moved_in_plane(drawn, target, steps), 10.0)
        right_or_none(picture, target, predicted, truth)


@pytest.mark.parametrize("target", ALL, ids=lambda target: target.kind)
def test_a_motion_during_the_exposure_moves_points_from_its_middle_by_little_of_it(target):
    drawn = usual(target, noise=0)
    truth = truth_of(drawn, target)
    # Longer ones smear a tag's border into its cells.
    for length in (3,) if isinstance(target, AprilGrid) else (3, 8, 20):
        smeared = cv2.filter2D(drawn.picture, -1, np.full((1, length), 1 / length))
        # The anchor of an even kernel is half a pixel off its middle.
        middle = truth - [0.5 * (1 - length % 2), 0]
        right_or_none(smeared, target, expected(truth, 5.0), middle, right=RIGHT + length / 16)


@pytest.mark.parametrize("target", ALL, ids=lambda target: target.kind)
def test_a_target_that_moved_no_further_than_said_is_found_where_it_is(target):
    drawn = usual(target)
    truth = truth_of(drawn, target)
    least = np.linalg.norm(truth[:, None] - truth, axis=2)
    reach = 0.35 * least[least > 0].min()

    @settings(max_examples=40, deadline=None, derandomize=True)
    @given(
        angle=st.floats(0, 2 * np.pi),
        part=st.floats(0, 1),
        turn=st.floats(-0.03, 0.03),
        scale=st.floats(0.98, 1.02),
    )
    @example(angle=5.5, part=0.75, turn=0.0, scale=1.0)  # most of the white round a ChArUco board's markers
    @example(angle=0.4, part=0.67, turn=0.0, scale=1.0)
    def look(angle: float, part: float, turn: float, scale: float) -> None:
        middle = truth.mean(axis=0)
        turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) * scale
        step = part * reach / 2 * np.array([np.cos(angle), np.sin(angle)])
        predicted = (truth - middle) @ turned.T + middle + step
        off = np.linalg.norm(predicted - truth, axis=1).max() + 0.5
        assert right_or_none(drawn.picture, target, expected(predicted, off), truth) >= 0.8 * len(truth)

    look()


@pytest.mark.parametrize("target", ALL, ids=lambda target: target.kind)
def test_any_prediction_gives_the_right_points_or_none(target):
    drawn = usual(target)
    truth = truth_of(drawn, target)
    readings = [truth, *(truth[symmetry.permutation] for symmetry in target_symmetries(target))]

    @settings(max_examples=60, deadline=None, derandomize=True)
    @given(
        turn=st.floats(-np.pi, np.pi),
        scale=st.floats(0.3, 2.0),
        x=st.floats(-400, 400),
        y=st.floats(-400, 400),
        off=st.floats(0, 100),
    )
    def look(turn: float, scale: float, x: float, y: float, off: float) -> None:
        middle = truth.mean(axis=0)
        turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) * scale
        predicted = (truth - middle) @ turned.T + middle + [x, y]
        right_or_none(drawn.picture, target, expected(predicted, off), *readings)

    look()


def test_colour_and_depth_are_no_matter():
    target = GRIDS[0]
    drawn = usual(target)
    truth = truth_of(drawn, target)
    grey = drawn.picture
    for picture in (cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), grey.astype(np.uint16) * 257, grey[..., None]):
        assert right_or_none(picture, target, expected(truth + 2), truth) == len(truth)


@pytest.mark.parametrize("target", GRIDS[:2], ids=lambda target: target.kind)
def test_light_disks_on_dark_paper_are_tracked_too(target):
    drawn = usual(target, inverted=True)
    truth = truth_of(drawn, target)
    assert right_or_none(drawn.picture, target, expected(truth + 2), truth) == len(truth)


def test_points_that_were_not_predicted_are_found_by_where_the_others_are():
    target = GRIDS[0]
    drawn = usual(target)
    truth = truth_of(drawn, target)
    part = np.flatnonzero(np.arange(42) % 7 < 4)
    assert right_or_none(drawn.picture, target, Prediction(part, truth[part], 3.0), truth) == len(truth)


def test_the_claimed_covariance_holds():
    target = GRIDS[0]
    truth = truth_of(usual(target), target)
    squares = []
    for seed in range(8):
        detection = track(usual(target, noise=3, seed=seed).picture, target, expected(truth + 0.6))
        errors = detection.pixels - truth
        squares.append(
            np.sum(errors * np.linalg.solve(detection.covariances, errors[..., None])[..., 0]) / errors.size
        )
    # 672 squared normal deviates: a standard error of 0.055.
    assert 0.75 < np.mean(squares) < 1.35


@pytest.mark.parametrize(
    ("ids", "pixels"),
    [([0, 1, 2], [[0, 0], [9, 0], [0, 9]]), ([0, 1, 2, 3], [[0, 0], [9, 0], [18, 0], [27, 0]])],
)
def test_a_prediction_of_too_few_points_is_refused(ids, pixels):
    prediction = Prediction(np.array(ids), np.array(pixels, dtype=float), 3.0)
    with pytest.raises(DetectionError, match="don't tell where the target lies"):
        track(usual(GRIDS[0]).picture, GRIDS[0], prediction)


@pytest.mark.parametrize("away", [2000.0, -2000.0])
def test_a_prediction_out_of_the_picture_is_refused(away):
    drawn = usual(GRIDS[0])
    with pytest.raises(DetectionError, match="out of the picture"):
        track(drawn.picture, GRIDS[0], expected(drawn.points + away))


@pytest.mark.parametrize(
    "image", [None, np.zeros((600, 800)), np.zeros((4, 4), np.uint8), np.zeros(9, np.uint8)]
)
def test_what_is_no_picture_is_refused(image):
    with pytest.raises(DetectionError):
        track(image, GRIDS[0], expected(usual(GRIDS[0]).points))


def test_without_a_target_nothing_can_be_tracked():
    with pytest.raises(DetectionError, match="camera poses"):
        track(usual(GRIDS[0]).picture, NoTarget(), expected(np.zeros((4, 2))))
