"""The ink of a printed target: what a printer draws and the detector is to find, as shapes in the world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import assert_never

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.targets import (
    AprilGrid,
    AsymmetricCircleGrid,
    Charuco,
    Chessboard,
    CircleGrid,
    NoTarget,
    Target,
    marker_cells,
    marker_dictionary,
    target_points,
)


@dataclass(frozen=True, eq=False)
class Ink:
    """Black shapes on white paper, in metres, x to the right and y down. No two of them overlap.

    `rectangles` (n, 4) are left, top, width and height; `disks` (m, 3) are the centre's x and y and the diameter.
    """

    rectangles: NDArray[np.float64]
    disks: NDArray[np.float64]

    def moved(self, x: float, y: float) -> Ink:
        """Return the same shapes, moved."""
        return Ink(self.rectangles + np.array([x, y, 0, 0]), self.disks + np.array([x, y, 0]))

    def with_rectangles(self, rectangles: NDArray[np.float64]) -> Ink:
        """Return these shapes and others (n, 4)."""
        return Ink(np.concatenate([self.rectangles, rectangles]), self.disks)

    def extent(self) -> tuple[float, float, float, float]:
        """Return the left, top, right and bottom ends of the ink, of which there must be some."""
        corners = self.disks[:, :2] - self.disks[:, 2:] / 2
        first = np.concatenate([self.rectangles[:, :2], corners])
        last = np.concatenate([self.rectangles[:, :2] + self.rectangles[:, 2:], corners + self.disks[:, 2:]])
        (left, top), (right, bottom) = first.min(axis=0).tolist(), last.max(axis=0).tolist()
        return left, top, right, bottom


def target_ink(target: Target) -> Ink:
    """Return the ink of a target in its own frame, the world; none for `NoTarget`."""
    match target:
        case NoTarget():
            return Ink(np.empty((0, 4)), np.empty((0, 3)))
        case CircleGrid() | AsymmetricCircleGrid():
            disks = target_points(target)
            disks[:, 2] = target.disk_diameter
            return Ink(np.empty((0, 4)), disks)
        case Chessboard():
            black, _ = _squares(target.rows + 1, target.columns + 1)
            return Ink(_boxes((black - 1) * target.pitch, target.pitch), np.empty((0, 3)))
        case Charuco():
            black, white = _squares(target.rows, target.columns)
            squares = Ink(_boxes((black - 1) * target.pitch, target.pitch), np.empty((0, 3)))
            corners = (white - 1) * target.pitch + (target.pitch - target.marker) / 2
            return squares.with_rectangles(_markers(target.dictionary, corners, target.marker))
        case AprilGrid():
            corners = target_points(target)[::4, :2]
            return Ink(_markers(target.dictionary, corners, target.tag), np.empty((0, 3)))
        case _:
            assert_never(target)


def white_rim(target: Target) -> float:
    """Return how much white (m) the ink wants around it, to be found.

    A square's width for a chessboard, half of one for a ChArUco board, whose markers have white of their own; as much
    as between tags, and half of what is between disks.
    """
    match target:
        case NoTarget():
            return 0.0
        case CircleGrid() | AsymmetricCircleGrid():
            return (target.spacing - target.disk_diameter) / 2
        case Chessboard():
            return target.pitch
        case Charuco():
            return target.pitch / 2
        case AprilGrid():
            return target.spacing
        case _:
            assert_never(target)


def _squares(rows: int, columns: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Column and row, as floats, of a chessboard's black squares (n, 2) and of its white ones (m, 2), row by row."""
    row, column = np.divmod(np.arange(rows * columns, dtype=np.int64), columns)
    squares = np.column_stack([column, row]).astype(np.float64)
    black = (row + column) % 2 == 0
    return squares[black], squares[~black]


def _boxes(corners: NDArray[np.float64], side: float) -> NDArray[np.float64]:
    """Squares (n, 4) with these top left corners (n, 2)."""
    return np.column_stack([corners, np.full((len(corners), 2), side)])


def _markers(dictionary: str, corners: NDArray[np.float64], side: float) -> NDArray[np.float64]:
    """Draw markers 0, 1, ... with their top left corners (n, 2): a rectangle (m, 4) for each run of black cells."""
    markers, cells = marker_dictionary(dictionary), marker_cells(dictionary)
    cell = side / cells
    drawn = []
    for number, corner in enumerate(corners):
        black = cv2.aruco.generateImageMarker(markers, number, cells) == 0
        steps = np.diff(np.pad(black, ((0, 0), (1, 1))).astype(np.int8), axis=1)
        row, first = np.nonzero(steps == 1)
        _, after = np.nonzero(steps == -1)
        runs = np.column_stack([first, row, after - first, np.ones(len(row))]) * cell
        drawn.append(runs + np.pad(corner, (0, 2)))
    return np.concatenate(drawn)
