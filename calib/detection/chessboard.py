"""Chessboards: their inner corners, read with the colours in place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.corners import measure_corners
from calib.detection.detection import Detection
from calib.detection.labelling import is_mirrored, upright
from calib.detection.picture import Picture, copies, in_original
from calib.detection.plane import span_a_plane, view_of_plane
from calib.errors import DetectionError
from calib.targets import Chessboard, target_points

SEARCHED_SIDE = 800
MIDDLE, BESIDE_CORNER = 0.5, 0.15  # places in a square, in steps from corner to corner along both sides
LEAST_CONTRAST = 0.15  # beside a corner, of that in the middle; disks have it in the middle alone
LEAST_CHEQUERED = 0.9  # of the corners
COPYS_ERROR = 1.5  # px of the copy
FORESHORTENED = 2  # how much narrower for its length a board may look than it is, and be found in any strip
STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 10, 0.1)

Search = Callable[[NDArray[np.uint8], tuple[int, int]], tuple[bool, cv2.typing.MatLike]]


def detect_chessboard(picture: Picture, target: Chessboard) -> Detection:
    """Find the inner corners, all of them roughly; raises DetectionError where that fails.

    Corners that cannot be measured, as under a hand, are left out: the search only guesses them.
    """
    candidates = (grid[:, ::-1] if is_mirrored(grid) else grid for grid in _found(picture.grey, target))
    boards = (_with_colours_in_place(picture.grey, grid) for grid in candidates)
    grid = next((board for board in boards if board is not None), None)
    not_found = DetectionError(
        f"the chessboard of {target.rows} x {target.columns} inner corners was not found in the picture "
        f"of {picture.size}: is the whole board in it, with a white rim, sharp and evenly lit?"
    )
    if grid is None:
        raise not_found
    points = target_points(target)[:, :2]
    rough = grid.reshape(-1, 2)
    view = view_of_plane(points, rough)
    if view is None:
        raise not_found
    corners = measure_corners(picture, view, points, rough, target.pitch, target.pitch / 2)
    reading = upright(target, corners.pixels)
    ids = np.flatnonzero(corners.found[reading])
    there = reading[ids]
    if not span_a_plane(points[ids]):
        raise not_found
    return Detection(ids, corners.pixels[there], corners.covariances[there], disk=None)


def _found(grey: NDArray[np.uint8], target: Chessboard) -> Iterator[NDArray[np.float64]]:
    """Search ever harder for corners (rows, columns, 2), in any of the orders that OpenCV may choose."""
    pattern = (target.columns, target.rows)
    for searched, scale, search in _searches(grey):
        found, corners = search(searched, pattern)
        if found:
            near = in_original(np.asarray(corners, dtype=np.float64), scale)
            yield _brought_near(grey, near, scale).reshape(*pattern[::-1], 2)


def _searches(grey: NDArray[np.uint8]) -> Iterator[tuple[NDArray[np.uint8], float, Search]]:
    """Give copies to search, each with its scale, and how.

    A board that fills enough of the picture is found in a copy of half its size or less, which has less noise, in a
    small part of the time. The whole of a larger picture is searched in the one way that does not take ever longer the
    more there is to be seen in it.
    """
    yield *next(copies(grey, min(max(grey.shape) // 2, SEARCHED_SIDE))), _quickly
    for searched, scale in copies(grey, SEARCHED_SIDE):
        for search in THOROUGHER if max(searched.shape) <= SEARCHED_SIDE else (_by_sectors,):
            yield searched, scale, search


def _quickly(grey: NDArray[np.uint8], pattern: tuple[int, int]) -> tuple[bool, cv2.typing.MatLike]:
    return cv2.findChessboardCorners(grey, pattern, flags=0)


def _by_quadrangles(grey: NDArray[np.uint8], pattern: tuple[int, int]) -> tuple[bool, cv2.typing.MatLike]:
    return cv2.findChessboardCorners(grey, pattern)


def _by_sectors(grey: NDArray[np.uint8], pattern: tuple[int, int]) -> tuple[bool, cv2.typing.MatLike]:
    """Search, but a long strip in parts that overlap by half.

    OpenCV turns what it searches in a square as wide as its longer side, and takes its time for all of that.
    """
    half = round(FORESHORTENED * min(grey.shape) * (max(pattern) + 1) / (min(pattern) + 1))
    for top, left in product(*(range(0, max(side - half, 1), half) for side in grey.shape)):
        part = grey[top : top + 2 * half, left : left + 2 * half]
        found, corners = cv2.findChessboardCornersSB(part, pattern)
        if found:
            return True, corners + np.array([left, top], dtype=np.float32)
    return False, np.empty(0, dtype=np.float32)


def _thoroughly(grey: NDArray[np.uint8], pattern: tuple[int, int]) -> tuple[bool, cv2.typing.MatLike]:
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    return cv2.findChessboardCornersSB(grey, pattern, flags=flags)


THOROUGHER = (_by_quadrangles, _by_sectors, _thoroughly)


def _brought_near(grey: NDArray[np.uint8], pixels: NDArray[np.float64], scale: float) -> NDArray[np.float64]:
    """Move corners found in a smaller copy by up to some of its pixels, of which a square has several."""
    if scale == 1:
        return pixels
    half = max(round(COPYS_ERROR / scale), 2)
    corners = np.ascontiguousarray(pixels, dtype=np.float32)
    return np.asarray(cv2.cornerSubPix(grey, corners, (half, half), (-1, -1), STOP), dtype=np.float64)


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
