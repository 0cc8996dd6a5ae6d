"""Whether points of a regular grid can be taken for their neighbours: by what is, and what isn't, beyond its rim."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.targets import AsymmetricCircleGrid, Chessboard, CircleGrid, target_points

FEWEST_WITNESSES = 2  # points, or places without one, that speak against each shift

Grid = CircleGrid | AsymmetricCircleGrid | Chessboard


@dataclass(frozen=True, eq=False)
class Lattice:
    """A grid on the lattice that its points are from.

    The points (n,) are at `columns` and `rows` of `occupied` (h, w). Beyond the rim are places (b,) of the lattice at
    `columns_beyond` and `rows_beyond`, each (`steps_beyond` (b, 2), m) away from the point `nearest` (b,).
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    rows_beyond: NDArray[np.int64]
    columns_beyond: NDArray[np.int64]
    nearest: NDArray[np.int64]
    steps_beyond: NDArray[np.float64]
    occupied: NDArray[np.float32]

    @cached_property
    def padded(self) -> NDArray[np.float32]:
        """The lattice `occupied`, with as much round it as a shift may take."""
        height, width = self.occupied.shape
        return np.pad(self.occupied, ((height - 1, height - 1), (width - 1, width - 1)))

    def is_certain(self, seen: NDArray[np.int64], empty: NDArray[np.int64]) -> bool:
        """Tell whether no shift of the grid explains the points `seen` and that places beyond the rim are `empty`."""
        evidence = np.zeros_like(self.occupied)
        evidence[self.rows[seen], self.columns[seen]] = 1
        evidence[self.rows_beyond[empty], self.columns_beyond[empty]] = -1
        # Shifted, the grid has a point where one was seen, or where none is.
        height, width = self.occupied.shape
        padded = np.pad(self.occupied, ((height - 1, height - 1), (width - 1, width - 1)))
        explained = np.asarray(
            cv2.filter2D(padded, -1, evidence, anchor=(0, 0), borderType=cv2.BORDER_CONSTANT)
        )
        against = len(seen) - explained[: 2 * height - 1, : 2 * width - 1]
        against[height - 1, width - 1] = FEWEST_WITNESSES
        return bool(against.min() > FEWEST_WITNESSES - 0.5)


def lattice_of(target: Grid) -> Lattice:
    """Put a grid on its lattice."""
    points = target_points(target)[:, :2]
    asymmetric = isinstance(target, AsymmetricCircleGrid)
    unit = target.pitch / 2 if asymmetric else target.pitch
    steps = np.array(
        [(1, 1), (-1, 1), (1, -1), (-1, -1), (2, 0), (-2, 0)]
        if asymmetric
        else [(1, 0), (-1, 0), (0, 1), (0, -1)]
    )
    places = np.rint(points / unit).astype(np.int64) + 2
    columns, rows = places.T
    occupied = np.zeros((rows.max() + 3, columns.max() + 3), dtype=np.float32)
    occupied[rows, columns] = 1
    around = places[:, None] + steps
    point, step = np.nonzero(occupied[around[..., 1], around[..., 0]] == 0)
    beyond, first = np.unique(around[point, step], axis=0, return_index=True)
    return Lattice(
        rows=rows,
        columns=columns,
        columns_beyond=beyond[:, 0],
        rows_beyond=beyond[:, 1],
        nearest=point[first],
        steps_beyond=unit * steps[step[first]],
        occupied=occupied,
    )
