"""What every printed pattern has: its points, and its ink as a signed distance.

Plate coordinates (m): origin at the first point (row 0, column 0), x along columns, y along rows, as in the
world.
"""

from abc import ABC, abstractmethod
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

Grid = NDArray[Any]
"""Floats of any shape and precision: rendering works in 32 bits, which are 1e-4 px on a plate."""
Points = NDArray[np.float64]
Box = tuple[float, float, float, float]
"""x and y of the top left, x and y of the bottom right."""
Count = Annotated[int, Field(ge=1)]
Size = Annotated[float, Field(gt=0)]


class Pattern(BaseModel, ABC):
    """A target as the profile's `[target]` describes it, lengths in metres."""

    # Keys that concern only who detects the target, such as how well its pitch is known, are not the world's.
    model_config = ConfigDict(extra="ignore", frozen=True, strict=True, defer_build=True)

    rows: Count
    columns: Count

    @abstractmethod
    def points(self) -> Points:
        """Return the points that are detected (n, 2); a point's id is its index."""

    @abstractmethod
    def box(self) -> Box:
        """Return the extent of the pattern, to which the paper's margin is added."""

    @abstractmethod
    def depth(self, x: Grid, y: Grid) -> Grid:
        """Return how deep in the ink places are (m): the distance to its edge, negative outside.

        It is exact to either side of an edge; far from edges only its sign counts. x and y are of one shape.
        """


def grid(rows: int, columns: int, pitch: float) -> Points:
    """Return the points (rows * columns, 2) of a square grid, row by row."""
    row, column = np.divmod(np.arange(rows * columns), columns)
    return np.column_stack([column * pitch, row * pitch])


def cells(x: Grid, y: Grid, side: float) -> tuple[Grid, Grid, Grid]:
    """Return the columns and rows of the square cells that places lie in, and how deep in them they are."""
    scale = 1 / side
    u, v = x * scale, y * scale
    column, row = np.floor(u), np.floor(v)
    u -= column + 0.5
    v -= row + 0.5
    inset = (0.5 - np.maximum(np.abs(u), np.abs(v))) * side
    return column.astype(np.int32), row.astype(np.int32), inset


def box_depth(x: Grid, y: Grid, box: Box) -> Grid:
    """Return how deep in a box places are (m), negative outside."""
    left, top, right, bottom = box
    depth: Grid = np.minimum(np.minimum(x - left, right - x), np.minimum(y - top, bottom - y))
    return depth
