"""The simulated sheet in the world: the printed target, the paper around it, and its shape."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.options import PlateOptions
from drivers.simulated.pattern import Box, Grid, box_depth
from drivers.simulated.target import Target


@dataclass(frozen=True)
class Plate:
    """A target on paper in the world's plane z = 0, which may bulge towards negative z, where cameras are."""

    target: Target
    options: PlateOptions

    @property
    def box(self) -> Box:
        """The paper's extent in the world: x and y of the top left, x and y of the bottom right (m)."""
        left, top, right, bottom = self.target.box()
        margin, scale = self.options.margin, self.options.print_scale
        return (
            (left - margin) * scale,
            (top - margin) * scale,
            (right + margin) * scale,
            (bottom + margin) * scale,
        )

    def height(self, x: Grid, y: Grid) -> Grid:
        """Return the world's z (m) of the paper at x, y: 0 along its edges and beyond."""
        left, top, right, bottom = self.box
        across = (x - (left + right) / 2) * (2 / (right - left))
        down = (y - (top + bottom) / 2) * (2 / (bottom - top))
        dome = np.clip(1 - across * across, 0, None) * np.clip(1 - down * down, 0, None)
        height: Grid = dome * -self.options.bulge
        return height

    def points(self) -> NDArray[np.float64]:
        """Return where the target's points truly are in the world (n, 3)."""
        xy = self.target.points() * self.options.print_scale
        return np.column_stack([xy, self.height(xy[:, 0], xy[:, 1])])

    def outline(self) -> NDArray[np.float64]:
        """Return points (n, 3) along the paper's edge."""
        left, top, right, bottom = self.box
        s = np.linspace(0.0, 1.0, 33)[:-1]
        x, y = left + (right - left) * s, top + (bottom - top) * s
        edges = [
            (x, np.full_like(s, top)),
            (np.full_like(s, right), y),
            (x[::-1], np.full_like(s, bottom)),
            (np.full_like(s, left), y[::-1]),
        ]
        return np.concatenate([np.column_stack([u, v, np.zeros_like(s)]) for u, v in edges])

    def paper_depth(self, x: Grid, y: Grid) -> Grid:
        """Return how far within the paper's edges places of the plane are (m), negative outside."""
        return box_depth(x, y, self.box)

    def ink_depth(self, x: Grid, y: Grid) -> Grid:
        """Return how deep in the ink places of the plane are (m), negative outside."""
        scale = self.options.print_scale
        depth: Grid = self.target.depth(x * (1 / scale), y * (1 / scale)) * scale
        return depth
