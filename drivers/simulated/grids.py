"""Targets without codes: disks and squares."""

from typing import Literal

import numpy as np

from drivers.simulated.pattern import Box, Grid, Pattern, Points, Size, box_depth, cells, grid


class CircleGrid(Pattern):
    """Black disks on a square grid; `pitch` apart."""

    kind: Literal["circle_grid"]
    pitch: Size
    disk_diameter: Size

    def points(self) -> Points:
        """Return the disks' centres (n, 2)."""
        return grid(self.rows, self.columns, self.pitch)

    def box(self) -> Box:
        """Return the extent of the ink."""
        r = self.disk_diameter / 2
        return -r, -r, (self.columns - 1) * self.pitch + r, (self.rows - 1) * self.pitch + r

    def depth(self, x: Grid, y: Grid) -> Grid:
        """Return the depth in the disks."""
        return _disks(x, y, (self.rows, self.columns), self.pitch, self.disk_diameter)


class AsymmetricCircleGrid(Pattern):
    """Black disks; odd rows are shifted by half a pitch, and rows are half a pitch apart."""

    kind: Literal["asymmetric_circle_grid"]
    pitch: Size
    """Spacing along a row's own disks."""
    disk_diameter: Size

    def points(self) -> Points:
        """Return the disks' centres (n, 2)."""
        row, column = np.divmod(np.arange(self.rows * self.columns), self.columns)
        return np.column_stack([2 * column + row % 2, row]) * (self.pitch / 2)

    def box(self) -> Box:
        """Return the extent of the ink."""
        r = self.disk_diameter / 2
        right, bottom = self.points().max(axis=0) + r
        return -r, -r, float(right), float(bottom)

    def depth(self, x: Grid, y: Grid) -> Grid:
        """Return the depth in the disks."""
        # Even and odd rows are each a square grid of the full pitch.
        even = _disks(x, y, ((self.rows + 1) // 2, self.columns), self.pitch, self.disk_diameter)
        if self.rows == 1:
            return even
        half = self.pitch / 2
        odd = _disks(x - half, y - half, (self.rows // 2, self.columns), self.pitch, self.disk_diameter)
        deeper: Grid = np.maximum(even, odd)
        return deeper


class Chessboard(Pattern):
    """Squares of side `pitch`; rows and columns count the inner corners. The top left square is black."""

    kind: Literal["chessboard"]
    pitch: Size

    def points(self) -> Points:
        """Return the inner corners (n, 2)."""
        return grid(self.rows, self.columns, self.pitch)

    def box(self) -> Box:
        """Return the extent of the squares."""
        return -self.pitch, -self.pitch, self.columns * self.pitch, self.rows * self.pitch

    def depth(self, x: Grid, y: Grid) -> Grid:
        """Return the depth in the black squares."""
        column, row, inset = cells(x, y, self.pitch)
        depth: Grid = np.where((column + row) % 2 == 0, inset, -inset)
        return np.minimum(depth, box_depth(x, y, self.box()))


def _disks(x: Grid, y: Grid, shape: tuple[int, int], pitch: float, diameter: float) -> Grid:
    rows, columns = shape
    dx, dy = _offset(x, pitch, columns), _offset(y, pitch, rows)
    depth: Grid = diameter / 2 - np.sqrt(dx * dx + dy * dy)
    return depth


def _offset(values: Grid, pitch: float, count: int) -> Grid:
    """Return the offsets of `values` from the nearest of `count` places that are `pitch` apart."""
    index = np.rint(values * values.dtype.type(1 / pitch))
    np.clip(index, 0, count - 1, out=index)
    index *= -pitch
    offset: Grid = index + values
    return offset
