"""Drawn targets of all kinds, seen from all sides: found, numbered as they are, and measured."""

import numpy as np
import pytest
from drawn_targets import Drawn, draw, project

from calib.detection import Detection, detect
from calib.errors import DetectionError
from calib.targets import (
    AprilGrid,
    AsymmetricCircleGrid,
    Charuco,
    Chessboard,
    CircleGrid,
    Target,
    target_points,
    target_symmetries,
)

CIRCLES = CircleGrid(rows=6, columns=7, pitch=0.03, disk_diameter=0.018)
SQUARE_CIRCLES = CircleGrid(rows=5, columns=5, pitch=0.03, disk_diameter=0.012)
ASYMMETRIC = AsymmetricCircleGrid(rows=7, columns=4, pitch=0.04, disk_diameter=0.016)
ASYMMETRIC_EVEN = AsymmetricCircleGrid(rows=6, columns=5, pitch=0.04, disk_diameter=0.016)
CHESSBOARD = Chessboard(rows=6, columns=9, pitch=0.025)
CHESSBOARD_ODD = Chessboard(rows=5, columns=7, pitch=0.025)
CHESSBOARD_SQUARE = Chessboard(rows=6, columns=6, pitch=0.025)
CHESSBOARD_SQUARE_ODD = Chessboard(rows=7, columns=7, pitch=0.025)
CHARUCO = Charuco(rows=5, columns=7, pitch=0.03, marker=0.021, dictionary="DICT_5X5_100")
APRILGRID = AprilGrid(rows=4, columns=5, tag=0.03, spacing=0.009)

GRIDS = [CIRCLES, SQUARE_CIRCLES, ASYMMETRIC, ASYMMETRIC_EVEN]
CHESSBOARDS = [CHESSBOARD, CHESSBOARD_ODD, CHESSBOARD_SQUARE, CHESSBOARD_SQUARE_ODD]
ALL = [*GRIDS, *CHESSBOARDS, CHARUCO, APRILGRID]


def name(value: object) -> str | None:
    if isinstance(value, CircleGrid | AsymmetricCircleGrid | Chessboard | Charuco | AprilGrid):
        return f"{value.kind}-{value.rows}x{value.columns}"
    return None


def truth(drawn: Drawn, target: Target, detection: Detection) -> np.ndarray:
    """What should have been measured, in the reading whose point 0 is nearest to the top left corner."""
    points = drawn.points
    readings = [np.arange(len(points)), *(symmetry.permutation for symmetry in target_symmetries(target))]
    reading = min(readings, key=lambda reading: np.linalg.norm(points[reading[0]]))
    measured = points if detection.disk is None else drawn.disk_centroids(target)
    return measured[reading][detection.ids]


def errors(drawn: Drawn, target: Target, detection: Detection) -> np.ndarray:
    return np.linalg.norm(detection.pixels - truth(drawn, target, detection), axis=1)


@pytest.mark.parametrize("roll", [0, 33, 90, 137, 180, -90])
@pytest.mark.parametrize("target", ALL, ids=name)
def test_every_point_has_its_own_id_from_every_side(target, roll):
    drawn = draw(target, roll=roll, tilt=(20, -15), fill=0.5, noise=2)
    detection = detect(drawn.picture, target)
    np.testing.assert_array_equal(detection.ids, np.arange(len(target_points(target))))
    assert errors(drawn, target, detection).max() < 0.2


@pytest.mark.parametrize("target", ALL, ids=name)
@pytest.mark.parametrize(
    ("view", "disk_limit", "corner_limit"),
    [
        pytest.param({}, 0.01, 0.07, id="clean"),
        pytest.param({"tilt": (35, 30)}, 0.02, 0.1, id="tilted by 45 degrees"),
        pytest.param({"tilt": (20, 15), "shading": 0.6}, 0.03, 0.1, id="shaded"),
        pytest.param({"tilt": (10, -20), "blur": 1.2, "roll": 12}, 0.01, 0.1, id="blurred"),
    ],
)
def test_points_are_where_they_are_to_a_fraction_of_a_pixel(target, view, disk_limit, corner_limit):
    drawn = draw(target, fill=0.6, **view)
    detection = detect(drawn.picture, target)
    limit = disk_limit if detection.disk else corner_limit
    assert errors(drawn, target, detection).max() < limit


@pytest.mark.parametrize("target", [CIRCLES, ASYMMETRIC, CHESSBOARD, APRILGRID], ids=name)
def test_covariances_are_those_of_repeated_pictures(target):
    pictures = [draw(target, tilt=(20, 15), fill=0.5, noise=6, seed=seed) for seed in range(8)]
    detections = [detect(drawn.picture, target) for drawn in pictures]
    scatter = np.var([detection.pixels for detection in detections], axis=0, ddof=1).mean()
    claimed = np.mean([np.trace(detection.covariances, axis1=1, axis2=2) / 2 for detection in detections])
    assert 0.25 * claimed < scatter < 1.5 * claimed


@pytest.mark.parametrize("target", [CIRCLES, CHESSBOARD, APRILGRID], ids=name)
def test_points_of_a_noisy_picture_weigh_less(target):
    calm, noisy = (detect(draw(target, fill=0.5, noise=noise).picture, target) for noise in (1, 8))
    assert np.trace(noisy.covariances.mean(axis=0)) > 1.5 * np.trace(calm.covariances.mean(axis=0))


@pytest.mark.parametrize("target", ALL, ids=name)
def test_covariances_are_symmetric_and_positive(target):
    covariances = detect(draw(target, tilt=(20, 15), fill=0.5).picture, target).covariances
    np.testing.assert_allclose(covariances, covariances.swapaxes(1, 2), atol=1e-15)
    assert np.linalg.eigvalsh(covariances).min() > 0


@pytest.mark.parametrize("target", GRIDS, ids=name)
def test_light_disks_on_dark_paper_are_disks_too(target):
    drawn = draw(target, tilt=(20, 15), fill=0.6, inverted=True, shading=0.5, noise=1)
    detection = detect(drawn.picture, target)
    assert detection.disk == "centroid"
    assert errors(drawn, target, detection).max() < 0.04


def test_disks_are_marked_as_centroids_and_corners_are_not():
    assert detect(draw(CIRCLES).picture, CIRCLES).disk == "centroid"
    assert detect(draw(CHESSBOARD).picture, CHESSBOARD).disk is None
    assert detect(draw(CHARUCO).picture, CHARUCO).disk is None
    assert detect(draw(APRILGRID).picture, APRILGRID).disk is None


def test_an_inverted_chessboard_is_the_same_board_turned_half_way():
    upright = draw(CHESSBOARD, fill=0.6)
    detection = detect(draw(CHESSBOARD, fill=0.6, inverted=True).picture, CHESSBOARD)
    assert np.abs(detection.pixels - upright.points[::-1]).max() < 0.1


@pytest.mark.parametrize("target", ALL, ids=name)
def test_a_mirrored_picture_is_never_read_as_the_target_from_behind(target):
    drawn = draw(target, tilt=(20, -15), fill=0.5)
    try:
        detection = detect(np.fliplr(drawn.picture), target)
    except DetectionError:
        return
    points = target_points(target)[detection.ids, :2]
    design = np.column_stack([points, np.ones(len(points))])
    pixels_from_plane = np.linalg.lstsq(design, detection.pixels, rcond=None)[0][:2]
    assert np.linalg.det(pixels_from_plane) > 0


@pytest.mark.parametrize("target", [CIRCLES, CHESSBOARD, CHARUCO, APRILGRID], ids=name)
def test_a_large_picture_is_searched_small_and_measured_whole(target):
    drawn = draw(target, tilt=(20, 15), fill=0.6, size=(1920, 1440), noise=1)
    assert errors(drawn, target, detect(drawn.picture, target)).max() < 0.06


@pytest.mark.parametrize("target", [CIRCLES, ASYMMETRIC, CHESSBOARD], ids=name)
def test_a_target_too_small_for_the_quick_search_is_still_found(target):
    drawn = draw(target, fill=0.09, size=(1920, 1440), shift=(300, -200))
    assert errors(drawn, target, detect(drawn.picture, target)).max() < 0.2


def test_a_charuco_board_partly_in_view_gives_the_corners_that_are():
    drawn = draw(CHARUCO, fill=0.8, shift=(250, 0))
    detection = detect(drawn.picture, CHARUCO)
    assert 4 <= len(detection.ids) < len(drawn.points)
    assert np.all(np.diff(detection.ids) > 0)
    assert errors(drawn, CHARUCO, detection).max() < 0.1


@pytest.mark.parametrize("square", [(0, 1), (2, 3), (4, 5)], ids=["corner", "middle", "rim"])
def test_a_charuco_marker_that_is_covered_takes_no_corner_with_it(square):
    row, column = square
    drawn = draw(CHARUCO, fill=0.7, noise=2)
    margin = (CHARUCO.pitch - CHARUCO.marker) / 2
    ends = np.array([0, CHARUCO.marker]) + margin - CHARUCO.pitch
    cover = np.array([(x, y) for y in ends for x in ends]) + CHARUCO.pitch * np.array([column, row])
    left, top, right, bottom = project(drawn.picture_from_world, cover)[[0, 3]].ravel().round().astype(int)
    drawn.picture[top:bottom, left:right] = 200
    detection = detect(drawn.picture, CHARUCO)
    np.testing.assert_array_equal(detection.ids, np.arange(len(drawn.points)))
    assert errors(drawn, CHARUCO, detection).max() < 0.06


def test_tags_partly_in_view_are_numbered_by_their_own_ids():
    drawn = draw(APRILGRID, fill=0.8, shift=(-250, 100))
    detection = detect(drawn.picture, APRILGRID)
    assert 4 <= len(detection.ids) < len(drawn.points)
    assert np.all(np.diff(detection.ids) > 0)
    assert errors(drawn, APRILGRID, detection).max() < 0.1


def test_tags_that_are_not_the_grids_are_left_out():
    larger = AprilGrid(rows=5, columns=5, tag=0.03, spacing=0.009)
    drawn = draw(larger, fill=0.7)
    detection = detect(drawn.picture, APRILGRID)
    assert detection.ids.max() == 4 * 20 - 1
    assert np.abs(detection.pixels - drawn.points[detection.ids]).max() < 0.1


def test_a_tag_seen_twice_is_left_out():
    drawn = draw(APRILGRID, fill=0.6)
    left, top = np.floor(drawn.points[0]).astype(int) - 4
    right, bottom = np.ceil(drawn.points[2]).astype(int) + 5
    picture = drawn.picture.copy()
    picture[:, :110] = 225
    picture[20 : 20 + bottom - top, 20 : 20 + right - left] = drawn.picture[top:bottom, left:right]
    assert set(detect(picture, APRILGRID).ids // 4) == set(range(1, 20))


def test_a_tag_out_of_its_place_is_left_out():
    drawn = draw(APRILGRID, fill=0.6)
    tag = slice(4 * 7, 4 * 8)
    left, top = np.floor(drawn.points[tag][0]).astype(int) - 4
    right, bottom = np.ceil(drawn.points[tag][2]).astype(int) + 5
    picture = drawn.picture.copy()
    picture[:, :110] = 225
    picture[20 : 20 + bottom - top, 20 : 20 + right - left] = drawn.picture[top:bottom, left:right]
    picture[top:bottom, left:right] = 225
    assert set(detect(picture, APRILGRID).ids // 4) == set(range(20)) - {7}
