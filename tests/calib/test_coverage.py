"""How a set of views covers the picture: the figures of views made to have them, and the words."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib.coverage import coverage, missing_in_words
from calib.detection import Detection
from calib.targets import Charuco, CircleGrid, target_points

GRID = CircleGrid(rows=5, columns=7, pitch=0.03, disk_diameter=0.018)
SIZE = 1280, 960
POINTS = target_points(GRID)[:, :2]


def seen(pixels, ids=None):
    ids = np.arange(len(pixels)) if ids is None else ids
    return Detection(ids, pixels, np.tile(np.eye(2), (len(ids), 1, 1)), None)


def view(x, y, width, shear=0.0):
    """A view of the grid, its middle at x, y (shares of the picture), `width` px wide, sheared."""
    scale = width / np.ptp(POINTS[:, 0])
    flat = (POINTS - POINTS.mean(axis=0)) * scale
    return seen(flat @ np.array([[1, 0], [shear, 1]]) + [x * SIZE[0], y * SIZE[1]])


def test_one_view_in_the_middle_covers_its_size_alone():
    found = coverage(GRID, SIZE, [view(0.5, 0.5, 320)])
    assert (found.views, found.x, found.y) == (1, 0, 0)
    area = 320 * 320 * 4 / 6
    assert found.size == pytest.approx(np.sqrt(area / (1280 * 960)) / 0.4, rel=1e-6)
    assert found.skew == pytest.approx(0, abs=1e-6)
    assert np.sum(found.cells) == 35
    assert found.covered == pytest.approx(np.mean(np.array(found.cells) > 0))


def test_x_and_y_are_how_far_the_target_was_moved_of_what_it_can_be():
    side = np.sqrt(320 * 320 * 4 / 6)
    found = coverage(GRID, SIZE, [view(0.4, 0.5, 320), view(0.6, 0.55, 320)])
    assert found.x == pytest.approx(0.2 * 1280 / (1280 - side) / 0.7, rel=1e-6)
    assert found.y == pytest.approx(0.05 * 960 / (960 - side) / 0.7, rel=1e-6)


def test_the_skew_is_how_far_a_corner_is_off_a_right_one():
    found = coverage(GRID, SIZE, [view(0.5, 0.5, 320), view(0.5, 0.5, 320, shear=-0.1)])
    assert found.skew == pytest.approx(2 * np.arctan(0.1) / 0.5, rel=1e-4)


@pytest.mark.parametrize("lean", [10, 40])
def test_the_lean_is_the_angle_to_the_image_plane_of_the_view_that_leans_most(lean):
    leaning = view(0.5, 0.5, 320)
    leaning = seen((leaning.pixels - [640, 480]) * [1, np.cos(np.radians(lean))] + [640, 480])
    found = coverage(GRID, SIZE, [view(0.5, 0.5, 320), leaning])
    assert np.degrees(found.lean) == pytest.approx(lean, abs=0.1)
    assert any("deg at most" in sentence for sentence in missing_in_words(found)) == (lean == 10)


def test_views_all_over_leave_nothing_missing():
    places = [(x, y) for x in (0.2, 0.5, 0.8) for y in (0.2, 0.5, 0.8)]
    views = [view(x, y, 560, shear=0.4) for x, y in places]
    found = coverage(GRID, SIZE, views)
    assert (found.x, found.y, found.size, found.skew) == (1, 1, 1, 1)
    assert found.covered > 0.9
    assert missing_in_words(found) == []


def test_the_places_without_a_point_are_named():
    views = [view(x, y, 400, shear=0.4) for x in (0.2, 0.5, 0.8) for y in (0.2, 0.45)]
    views += [view(x, 0.8, 400, shear=-0.4) for x in (0.6, 0.8)]
    [sentence] = missing_in_words(coverage(GRID, SIZE, views))
    assert "in the lower left of the picture" in sentence


def test_small_targets_that_never_lean_are_told():
    views = [view(x, y, 150) for x in (0.1, 0.3, 0.5, 0.7, 0.9) for y in (0.1, 0.3, 0.5, 0.7, 0.9)]
    small, upright = missing_in_words(coverage(GRID, SIZE, views))
    assert "1 % of the picture at most" in small
    assert "leans by 0 deg at most" in upright


def test_no_view_at_all_is_said():
    assert missing_in_words(coverage(GRID, SIZE, [])) == ["no view shows the target"]
    nothing = seen(np.zeros((0, 2)), np.zeros(0, dtype=int))
    assert coverage(GRID, SIZE, [nothing]).views == 0


def test_points_on_one_line_have_no_skew():
    assert coverage(GRID, SIZE, [seen(view(0.5, 0.5, 320).pixels[:7], np.arange(7))]).skew == 0


@given(
    numbers=st.lists(st.integers(0, 23), min_size=1, max_size=24, unique=True),
    x=st.floats(0, 1),
    y=st.floats(0, 1),
    width=st.floats(1, 3000),
)
def test_parts_of_a_target_anywhere_give_shares(numbers, x, y, width):
    board = Charuco(rows=5, columns=7, pitch=0.03, marker=0.021, dictionary="DICT_5X5_100")
    ids = np.array(sorted(numbers))
    points = target_points(board)[:, :2]
    pixels = (points[ids] - points.mean(axis=0)) * width / 0.15 + [x * 1280, y * 960]
    found = coverage(board, SIZE, [seen(pixels, ids)])
    assert all(0 <= share <= 1 for share in (found.x, found.y, found.size, found.skew, found.covered))
    assert missing_in_words(found)
