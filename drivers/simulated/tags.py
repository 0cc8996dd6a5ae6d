"""Targets with codes: ChArUco boards and grids of AprilTags."""

from functools import lru_cache
from typing import Literal

import numpy as np

from drivers.errors import OptionsError
from drivers.simulated.pattern import Box, Grid, Mask, Pattern, Points, Size, cells, grid


class Charuco(Pattern):
    """A chessboard of rows x columns squares with markers in the white ones, as OpenCV prints a CharucoBoard.

    Points are the inner corners with OpenCV's ids: row by row from the top left.
    """

    kind: Literal["charuco"]
    pitch: Size
    """Side of a square."""
    marker: Size
    """Side of a marker."""
    dictionary: str

    def marker_count(self) -> int:
        """Return how many markers there are, with numbers from 0."""
        return self.rows * self.columns // 2

    def points(self) -> Points:
        """Return the inner corners (n, 2)."""
        return grid(self.rows - 1, self.columns - 1, self.pitch)

    def box(self) -> Box:
        """Return the extent of the squares."""
        return -self.pitch, -self.pitch, (self.columns - 1) * self.pitch, (self.rows - 1) * self.pitch

    def ink(self, x: Grid, y: Grid) -> Mask:
        """Return where squares and markers are black."""
        u, v = x + self.pitch, y + self.pitch  # from the board's top left
        column, row = cells(u, v, self.pitch)
        inside = (column >= 0) & (column < self.columns) & (row >= 0) & (row < self.rows)
        black = (column + row) % 2 == 0
        # Markers are numbered along the white squares, row by row.
        white_before = (np.arange(self.rows) * self.columns) // 2
        first_white = (np.arange(self.rows) + 1) % 2
        r = np.clip(row, 0, self.rows - 1)
        number = white_before[r] + (column - first_white[r]) // 2
        bits = marker_bits(self.dictionary, self.marker_count())
        edge = (self.pitch - self.marker) / 2
        drawn = black_in_marker(
            bits, number, u - column * self.pitch - edge, v - row * self.pitch - edge, self.marker
        )
        ink: Mask = inside & (black | drawn)
        return ink


class AprilGrid(Pattern):
    """Tags of side `tag`, `spacing` apart, numbered row by row from the top left.

    Points are the tags' corners, top left, top right, bottom right, bottom left as seen on the print;
    id = 4 x tag + corner. `tag` is the black square's side, without the white around it.
    """

    kind: Literal["aprilgrid"]
    tag: Size
    spacing: Size
    family: Literal["16h5", "25h9", "36h10", "36h11"] = "36h11"

    @property
    def dictionary(self) -> str:
        """OpenCV's name of the family."""
        return f"DICT_APRILTAG_{self.family}"

    def marker_count(self) -> int:
        """Return how many tags there are, with numbers from 0."""
        return self.rows * self.columns

    def points(self) -> Points:
        """Return the tags' corners (n, 2)."""
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * self.tag
        first = grid(self.rows, self.columns, self.tag + self.spacing)
        return (first[:, None, :] + corners).reshape(-1, 2)

    def box(self) -> Box:
        """Return the extent of the tags."""
        step = self.tag + self.spacing
        return 0.0, 0.0, self.columns * step - self.spacing, self.rows * step - self.spacing

    def ink(self, x: Grid, y: Grid) -> Mask:
        """Return where the tags are black."""
        step = self.tag + self.spacing
        column, row = cells(x, y, step)
        inside = (column >= 0) & (column < self.columns) & (row >= 0) & (row < self.rows)
        number = row * self.columns + column
        bits = marker_bits(self.dictionary, self.marker_count())
        return inside & black_in_marker(bits, number, x - column * step, y - row * step, self.tag)


@lru_cache(maxsize=8)
def marker_bits(dictionary: str, count: int) -> Mask:
    """Return the cells (count, n, n) of markers 0, 1, ... with their black border, True where black.

    Raises OptionsError where OpenCV has no such dictionary or it has fewer markers.
    """
    import cv2

    code = getattr(cv2.aruco, dictionary, None) if dictionary.startswith("DICT_") else None
    if code is None:
        raise OptionsError(
            f"[target] names the dictionary '{dictionary}': OpenCV knows such as 'DICT_5X5_100'"
        )
    markers = cv2.aruco.getPredefinedDictionary(code)
    if count > len(markers.bytesList):
        raise OptionsError(
            f"[target] needs {count} different markers and {dictionary} has {len(markers.bytesList)}: "
            "choose a larger dictionary or fewer squares"
        )
    cells_across = markers.markerSize + 2
    drawn = [cv2.aruco.generateImageMarker(markers, number, cells_across) for number in range(count)]
    return np.asarray(np.array(drawn) == 0)


def black_in_marker(bits: Mask, number: Grid, x: Grid, y: Grid, side: float) -> Mask:
    """Return where places x, y from the top left of the markers `number` of this side are black."""
    count, n, _ = bits.shape
    column, row = cells(x, y, side / n)
    inside = (column >= 0) & (column < n) & (row >= 0) & (row < n)
    index = (np.clip(number, 0, count - 1) * n + np.clip(row, 0, n - 1)) * n + np.clip(column, 0, n - 1)
    black: Mask = inside & bits.ravel()[index]
    return black
