"""Chessboards: their inner corners, read with the colours in place."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.corners import corner_covariances, refine_corners
from calib.detection.detection import Detection
from calib.detection.labelling import is_mirrored, upright
from calib.detection.picture import Picture
from calib.errors import DetectionError
from calib.targets import Chessboard

SEARCHED_SIDE = 800
CLEAR_OF_NEIGHBOURS = 0.65  # of the distance to the next line of corners


def detect_chessboard(picture: Picture, target: Chessboard) -> Detection:
    """Find all inner corners; raises DetectionError where any is missing."""
    grid = next(_found(picture.grey, target), None)
    if grid is None:
        raise DetectionError(
            f"the chessboard of {target.rows} x {target.columns} inner corners was not found in the picture of "
            f"{picture.size}: is the whole board in it, with a white rim, sharp and evenly lit?"
        )
    if is_mirrored(grid):
        grid = grid[:, ::-1]
    grid = _with_colours_in_place(picture.grey, grid)
    reaches = CLEAR_OF_NEIGHBOURS * _line_spacings(grid)
    pixels = refine_corners(picture, grid.reshape(-1, 2), reaches)
    reading = upright(target, pixels)
    covariances = corner_covariances(picture, pixels, reaches)
    return Detection(np.arange(len(pixels)), pixels[reading], covariances[reading], disk=None)


def _found(grey: NDArray[np.uint8], target: Chessboard) -> Iterator[NDArray[np.float64]]:
    """Corners (rows, columns, 2), in any of the orders that OpenCV may choose, from the quickest search to the longest.

    A board that fills enough of the picture is found in a smaller copy, in a tenth of the time.
    """
    scale = SEARCHED_SIDE / max(grey.shape)
    scales = (scale, 1.0) if scale < 1 else (1.0,)
    for scale in scales:
        searched = grey
        if scale < 1:
            searched = np.asarray(cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA))
        for search in SEARCHES:
            found, corners = search(searched, (target.columns, target.rows))
            if found:
                # Pixel centres are whole numbers, so that the copies share their corners, not their origin.
                yield (np.asarray(corners, dtype=np.float64).reshape(target.rows, target.columns, 2) + 0.5) / scale - 0.5


Search = Callable[[NDArray[np.uint8], tuple[int, int]], tuple[bool, cv2.typing.MatLike]]

SEARCHES: tuple[Search, ...] = (
    lambda grey, pattern: cv2.findChessboardCornersSB(grey, pattern),
    lambda grey, pattern: cv2.findChessboardCorners(grey, pattern),
    lambda grey, pattern: cv2.findChessboardCornersSB(
        grey, pattern, flags=cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    ),
)


def _with_colours_in_place(grey: NDArray[np.uint8], grid: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn the grid so that the squares down and right of its corners (0, 0), (1, 1), (0, 2)... are the black ones.

    A half turn swaps the colours where rows + columns is odd, a quarter turn where the board is square and rows is odd.
    Where neither does, the board has no other reading.
    """
    rows, columns = grid.shape[:2]
    centres = (grid[:-1, :-1] + grid[:-1, 1:] + grid[1:, :-1] + grid[1:, 1:]) / 4
    x, y = np.rint(centres).astype(int).reshape(-1, 2).T
    values = grey[np.clip(y, 0, grey.shape[0] - 1), np.clip(x, 0, grey.shape[1] - 1)].astype(float)
    black = np.indices((rows - 1, columns - 1)).sum(axis=0).ravel() % 2 == 0
    if values[black].mean() < values[~black].mean():
        return grid
    if (rows + columns) % 2:
        return grid[::-1, ::-1]
    if rows == columns and rows % 2:
        return np.rot90(grid)
    return grid


def _line_spacings(grid: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance (rows * columns,) in px from each corner to the nearer of the next lines through corners."""
    along_rows, along_columns = np.gradient(grid, axis=(0, 1))
    area = np.abs(along_rows[..., 0] * along_columns[..., 1] - along_rows[..., 1] * along_columns[..., 0])
    longer = np.maximum(np.linalg.norm(along_rows, axis=-1), np.linalg.norm(along_columns, axis=-1))
    return np.asarray((area / longer).ravel())
