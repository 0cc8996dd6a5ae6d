"""Where the marks of a target are expected in a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.detection.marks import Marks
from calib.detection.plane import BentView, PlaneView

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Places:
    """Where in the picture `marks` are: what they say in m, in px.

    `listed` (n, 2) are the places as the marks list them, in the `view`; `across` (m, j, 2) is what is clear across
    edges.
    """

    marks: Marks
    view: BentView
    listed: Array
    across: Array

    @classmethod
    def expected(cls, marks: Marks, view: BentView) -> Places:
        """Project the marks; the lens bends each as it bends its middle."""
        bend = view.project(marks.middles) - view.view.project(marks.middles)
        listed = view.view.project(marks.places) + bend[marks.owners]
        edges, ahead = listed[-marks.edges.size :].reshape(2, *marks.edges.shape)
        return cls(marks, view, listed, ahead - edges)

    @property
    def points(self) -> Array:
        """Of each mark (m, q, 2)."""
        return self.listed[: self.marks.points.size].reshape(self.marks.positions.shape)

    @property
    def samples(self) -> Array:
        """Of each mark, and of each place beyond a grid's rim (m + b, k, 2)."""
        first = self.marks.points.size
        samples = self.listed[first : first + self.marks.colours.size]
        return samples.reshape(self.marks.samples.shape)

    @property
    def edges(self) -> Array:
        """Of each mark (m, j, 2)."""
        first = self.marks.points.size + self.marks.colours.size
        return self.listed[first : first + self.marks.edges.size // 2].reshape(self.marks.edges.shape)

    def moved(self, step: Sequence[int]) -> Places:
        """Shift all places by (2,) px."""
        return Places(self.marks, self.view.shifted(step), self.listed + step, self.across)

    def mapped(self, homography: Array) -> Places:
        """Move all places by a homography (3, 3) of the picture, which hardly turns or scales."""
        listed = PlaneView(homography).project(self.listed)
        return Places(self.marks, self.view.moved(homography), listed, self.across)
