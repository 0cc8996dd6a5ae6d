"""Targets with codes: ChArUco boards and grids of AprilTags."""

from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from drivers.errors import OptionsError
from drivers.simulated.pattern import Box, Grid, Pattern, Points, Size, box_depth, cells, grid

Bits = NDArray[np.bool_]


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

    def depth(self, x: Grid, y: Grid) -> Grid:
        """Return the depth in squares and markers."""
        u, v = x + self.pitch, y + self.pitch  # from the board's top left
        column, row, inset = cells(u, v, self.pitch)
        # Markers are numbered along the white squares, row by row.
        markers_above = (np.arange(self.rows, dtype=np.int32) * self.columns) // 2
        first_white = (np.arange(self.rows, dtype=np.int32) + 1) % 2
        r = np.clip(row, 0, self.rows - 1)
        number = markers_above[r] + (column - first_white[r]) // 2
        edge = (self.pitch - self.marker) / 2
        bits = marker_bits(self.dictionary, self.marker_count())
        from_left, from_top = u - column * self.pitch - edge, v - row * self.pitch - edge
        in_marker = marker_depth(bits, number, from_left, from_top, self.marker)
        in_white = np.maximum(in_marker, -inset)
        depth: Grid = np.where((column + row) % 2 == 0, inset, in_white)
        return np.minimum(depth, box_depth(x, y, self.box()))


class AprilGrid(Pattern):
    """Tags of side `tag`, `spacing` apart, numbered row by row from the top left.

    Points are the tags' corners, top left, top right, bottom right, bottom left as seen on the print;
    id = 4 x tag + corner. `tag` is the black square's side, without the white around it.
    """

    kind: Literal["aprilgrid"]
    tag: Size
    spacing: Size
    dictionary: str = "DICT_APRILTAG_36h11"

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

    def depth(self, x: Grid, y: Grid) -> Grid:
        """Return the depth in the tags' black cells."""
        step = self.tag + self.spacing
        # Cells with half of the white around a tag on each side.
        u, v = x + self.spacing / 2, y + self.spacing / 2
        column, row, _ = cells(u, v, step)
        c, r = np.clip(column, 0, self.columns - 1), np.clip(row, 0, self.rows - 1)
        bits = marker_bits(self.dictionary, self.marker_count())
        return marker_depth(bits, r * self.columns + c, x - c * step, y - r * step, self.tag)


@lru_cache(maxsize=8)
def marker_bits(dictionary: str, count: int) -> Bits:
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


def marker_depth(bits: Bits, number: Grid, x: Grid, y: Grid, side: float) -> Grid:
    """Return the depth (m) in the black cells of markers; x, y are from their top left.

    Outside of the marker it is the distance to the marker, negative.
    """
    count, n, _ = bits.shape
    column, row, inset = cells(x, y, side / n)
    index = (np.clip(number, 0, count - 1) * n + np.clip(row, 0, n - 1)) * n + np.clip(column, 0, n - 1)
    depth: Grid = np.where(bits.ravel()[index], inset, -inset)
    around = box_depth(x, y, (0.0, 0.0, side, side))
    return np.where(around > 0.0, depth, around)
