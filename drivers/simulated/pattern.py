"""What every printed pattern has: its points, their ids, and its ink.

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
Mask = NDArray[np.bool_]
Points = NDArray[np.float64]
Box = tuple[float, float, float, float]
"""x and y of the top left, x and y of the bottom right."""
Count = Annotated[int, Field(ge=1)]
Size = Annotated[float, Field(gt=0)]


class Pattern(BaseModel, ABC):
    """A target as the profile's `[target]` describes it, lengths in metres."""

    # Keys that concern only who detects the target, such as how well its pitch is known, are not the world's.
    model_config = ConfigDict(extra="ignore", frozen=True, strict=True)

    rows: Count
    columns: Count

    @abstractmethod
    def points(self) -> Points:
        """Return the points that are detected (n, 2); a point's id is its index."""

    @abstractmethod
    def box(self) -> Box:
        """Return the extent of the pattern, to which the paper's margin is added."""

    @abstractmethod
    def ink(self, x: Grid, y: Grid) -> Mask:
        """Return where the print is black, for arrays of any one shape."""


def grid(rows: int, columns: int, pitch: float) -> Points:
    """Return the points (rows * columns, 2) of a square grid, row by row."""
    row, column = np.divmod(np.arange(rows * columns), columns)
    return np.column_stack([column * pitch, row * pitch])


def cells(x: Grid, y: Grid, pitch: float) -> tuple[Grid, Grid]:
    """Return the integer column and row of the square cells of side `pitch` that the places lie in."""
    scale = 1 / pitch
    return np.floor(x * scale).astype(np.int32), np.floor(y * scale).astype(np.int32)
