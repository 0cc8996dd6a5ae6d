"""The ink of targets is where OpenCV's own drawings of boards have it, and what is said of it is so."""

import cv2
import numpy as np
import pytest

from calib.ink import Ink, target_ink, white_rim
from calib.targets import AprilGrid, AsymmetricCircleGrid, Charuco, Chessboard, CircleGrid, NoTarget

CHARUCO = Charuco(rows=5, columns=4, pitch=0.04, marker=0.028, dictionary="DICT_5X5_50")
CELL, CELLS = 0.002, 20  # of which its squares and its markers' cells are made; in a square


def drawn(ink: Ink, cell: float) -> np.ndarray:
    """Draw rectangles whose edges are on a grid of cells: how often each cell is covered."""
    left, top, right, bottom = ink.extent()
    picture = np.zeros((round((bottom - top) / cell), round((right - left) / cell)), dtype=int)
    cells = (ink.rectangles - [left, top, 0, 0]) / cell
    np.testing.assert_allclose(cells, np.rint(cells), atol=1e-9)
    for x, y, width, height in np.rint(cells).astype(int):
        picture[y : y + height, x : x + width] += 1
    return picture


@pytest.mark.parametrize("rows", [4, 5])
def test_a_charuco_board_is_the_one_that_opencv_draws(rows: int) -> None:
    target = CHARUCO.model_copy(update={"rows": rows})
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_50)
    board = cv2.aruco.CharucoBoard((4, rows), 0.04, 0.028, dictionary)
    side = 70  # pixels
    expected = board.generateImage((4 * side, rows * side))
    found = drawn(target_ink(target), CELL)
    middles = [np.rint((np.arange(n) + 0.5) * side / CELLS - 0.5).astype(int) for n in found.shape]
    black = expected[np.ix_(*middles)] == 0
    np.testing.assert_array_equal(found == 1, black)
    assert found.max() == 1
    assert target_ink(target).extent()[:2] == (-0.04, -0.04)


def test_tags_are_opencvs_row_by_row_from_the_top_left() -> None:
    target = AprilGrid(rows=2, columns=3, tag=0.04, spacing=0.015)
    found = drawn(target_ink(target), 0.005)  # eight cells a tag, three between tags
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    expected = np.zeros((2 * 11 - 3, 3 * 11 - 3), dtype=int)
    for tag in range(6):
        row, column = divmod(tag, 3)
        marker = cv2.aruco.generateImageMarker(dictionary, tag, 8) == 0
        expected[11 * row : 11 * row + 8, 11 * column : 11 * column + 8] = marker
    np.testing.assert_array_equal(found, expected)
    assert target_ink(target).extent()[:2] == (0, 0)


def test_a_chessboard_is_black_up_and_left_of_its_first_corner() -> None:
    found = drawn(target_ink(Chessboard(rows=3, columns=4, pitch=0.025)), 0.025)
    np.testing.assert_array_equal(found, 1 - np.indices((4, 5)).sum(axis=0) % 2)


def test_disks_are_round_their_points() -> None:
    ink = target_ink(AsymmetricCircleGrid(rows=4, columns=2, pitch=0.04, disk_diameter=0.01))
    np.testing.assert_allclose(ink.disks[:3], [[0, 0, 0.01], [0.04, 0, 0.01], [0.02, 0.02, 0.01]])
    np.testing.assert_allclose(ink.extent(), (-0.005, -0.005, 0.065, 0.065))


def test_no_target_has_no_ink() -> None:
    ink = target_ink(NoTarget())
    assert len(ink.rectangles) == len(ink.disks) == 0


@pytest.mark.parametrize(
    ("target", "rim"),
    [
        (Chessboard(rows=3, columns=4, pitch=0.025), 0.025),
        (CHARUCO, 0.02),
        (AprilGrid(rows=2, columns=3, tag=0.04, spacing=0.015), 0.015),
        (CircleGrid(rows=3, columns=3, pitch=0.03, disk_diameter=0.018), 0.006),
        (NoTarget(), 0),
    ],
)
def test_the_white_rim_is_as_wide_as_the_kind_needs(target, rim: float) -> None:
    assert white_rim(target) == pytest.approx(rim)
