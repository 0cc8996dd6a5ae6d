"""Chessboards: their inner corners, read with the colours in place."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.corners import corner_covariances, refine_corners
from calib.detection.detection import Detection
from calib.detection.labelling import is_mirrored, upright
from calib.detection.picture import Picture, copies, in_original
from calib.errors import DetectionError
from calib.targets import Chessboard

SEARCHED_SIDE = 800
MIDDLE, BESIDE_CORNER = 0.5, 0.15  # places in a square, in steps from corner to corner along both sides
LEAST_CONTRAST = 0.15  # beside a corner, of that in the middle; disks have it in the middle alone
LEAST_CHEQUERED = 0.9  # of the corners
CLEAR_OF_NEIGHBOURS = 0.45  # of the distance to the next corners; beyond half of it, theirs are seen too


def detect_chessboard(picture: Picture, target: Chessboard) -> Detection:
    """Find all inner corners; raises DetectionError where any is missing."""
    candidates = (grid[:, ::-1] if is_mirrored(grid) else grid for grid in _found(picture.grey, target))
    boards = (_with_colours_in_place(picture.grey, grid) for grid in candidates)
    grid = next((board for board in boards if board is not None), None)
    if grid is None:
        raise DetectionError(
            f"the chessboard of {target.rows} x {target.columns} inner corners was not found in the picture "
            f"of {picture.size}: is the whole board in it, with a white rim, sharp and evenly lit?"
        )
    reaches = CLEAR_OF_NEIGHBOURS * _line_spacings(grid)
    pixels = refine_corners(picture, grid.reshape(-1, 2), reaches)
    reading = upright(target, pixels)
    covariances = corner_covariances(picture, pixels, reaches)
    return Detection(np.arange(len(pixels)), pixels[reading], covariances[reading], disk=None)


def _found(grey: NDArray[np.uint8], target: Chessboard) -> Iterator[NDArray[np.float64]]:
    """Search ever harder for corners (rows, columns, 2), in any of the orders that OpenCV may choose.

    A board that fills enough of the picture is found in a smaller copy, in a tenth of the time.
    """
    pattern = (target.columns, target.rows)
    for searched, scale in copies(grey, SEARCHED_SIDE):
        for search in SEARCHES:
            found, corners = search(searched, pattern)
            if found:
                yield in_original(np.asarray(corners, dtype=np.float64), scale).reshape(*pattern[::-1], 2)


def _quickly(grey: NDArray[np.uint8], pattern: tuple[int, int]) -> tuple[bool, cv2.typing.MatLike]:
    return cv2.findChessboardCornersSB(grey, pattern)


def _by_quadrangles(grey: NDArray[np.uint8], pattern: tuple[int, int]) -> tuple[bool, cv2.typing.MatLike]:
    return cv2.findChessboardCorners(grey, pattern)


def _thoroughly(grey: NDArray[np.uint8], pattern: tuple[int, int]) -> tuple[bool, cv2.typing.MatLike]:
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    return cv2.findChessboardCornersSB(grey, pattern, flags=flags)


SEARCHES = (_quickly, _by_quadrangles, _thoroughly)


def _with_colours_in_place(grey: NDArray[np.uint8], grid: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Turn the grid so that the squares down and right of its corners (0, 0), (1, 1), (0, 2)... are black.

    A half turn swaps the colours where rows + columns is odd, a quarter turn where the board is square and
    rows is odd. Where neither does, the board has no other reading. None where the squares are not of two
    colours in turn: OpenCV takes other regular patterns, as of disks, for boards.
    """
    rows, columns = grid.shape[:2]
    chequers = (-1) ** np.indices((rows, columns)).sum(axis=0)
    contrast = float(np.median(chequers * _contrasts(grey, grid, MIDDLE)))
    beside = chequers * np.sign(contrast) * _contrasts(grey, grid, BESIDE_CORNER)
    if np.mean(beside > LEAST_CONTRAST * abs(contrast)) < LEAST_CHEQUERED:
        return None
    if contrast > 0:
        return grid
    if (rows + columns) % 2:
        return grid[::-1, ::-1]
    if rows == columns and rows % 2:
        return np.asarray(np.rot90(grid))
    return grid


def _contrasts(grey: NDArray[np.uint8], grid: NDArray[np.float64], place: float) -> NDArray[np.float64]:
    """Measure at each corner how much brighter its two squares on one diagonal are than those on the other.

    Positive (rows, columns) where the darker squares are the one down and right and the one up and left; 0
    where the four are not two and two.
    """
    along_columns: NDArray[np.float64] = place * np.gradient(grid, axis=0)
    along_rows: NDArray[np.float64] = place * np.gradient(grid, axis=1)
    falling, rising = along_rows + along_columns, along_rows - along_columns
    one, other = (
        np.stack([_values(grey, grid + diagonal), _values(grey, grid - diagonal)])
        for diagonal in (falling, rising)
    )
    one_is_darker = np.maximum(other.min(axis=0) - one.max(axis=0), 0)
    other_is_darker = np.maximum(one.min(axis=0) - other.max(axis=0), 0)
    return np.asarray(one_is_darker - other_is_darker)


def _values(grey: NDArray[np.uint8], pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Look up the grey values nearest to pixels (..., 2)."""
    last = np.array(grey.shape[::-1]) - 1
    nearest = np.clip(np.rint(pixels), 0, last).astype(int)
    return np.asarray(grey[nearest[..., 1], nearest[..., 0]], dtype=np.float64)


def _line_spacings(grid: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance (rows * columns,) in px from each corner to the nearer of the next lines through corners."""
    along_columns: NDArray[np.float64] = np.gradient(grid, axis=0)
    along_rows: NDArray[np.float64] = np.gradient(grid, axis=1)
    area = along_rows[..., 0] * along_columns[..., 1] - along_rows[..., 1] * along_columns[..., 0]
    longer = np.maximum(np.linalg.norm(along_rows, axis=-1), np.linalg.norm(along_columns, axis=-1))
    return np.asarray((np.abs(area) / longer).ravel())
