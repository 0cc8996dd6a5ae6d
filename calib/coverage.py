"""How well a set of views covers what a lens needs: places in the picture, distances, and leanings of the target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, radians, sqrt
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.health import tilt_of
from calib.detection.plane import PlaneView, view_of_plane
from calib.targets import Target, target_points

ROWS, COLUMNS = 6, 9
ENOUGH_X, ENOUGH_Y, ENOUGH_SIZE, ENOUGH_SKEW = 0.7, 0.7, 0.4, 0.5
LEAST_SIZE = 0.6  # of enough: less is said in words
LEAST_LEAN = radians(15)
PLACES = (
    ("upper left", "upper middle", "upper right"),
    ("middle left", "middle", "middle right"),
    ("lower left", "lower middle", "lower right"),
)

Array = NDArray[np.float64]


class SeenPoints(Protocol):
    """Points of a target by id (n,), and where they were seen (n, 2), px; a Detection is one."""

    @property
    def ids(self) -> NDArray[np.int64]:
        """The points' ids."""

    @property
    def pixels(self) -> Array:
        """Where they were seen."""


@dataclass(frozen=True)
class Coverage:
    """How well `views` of a target cover one camera's picture, as ROS's camera_calibration measures it.

    Each of `x`, `y`, `size` and `skew` is 1 where the views are as different as that package asks for: the
    target's middle from one side of the picture to the other, and from top to bottom, over 0.7 of the room that
    the target leaves; one view in which it fills 0.4 of the picture (the root of its area's share); one in which
    a corner of it is 0.25 rad off a right angle. `lean` (rad) is the largest angle to the image plane. `cells`
    are how many points were seen in each cell of a grid of 6 x 9 over the picture, `covered` is the share of cells
    with any.
    """

    views: int
    x: float
    y: float
    size: float
    skew: float
    lean: float
    covered: float
    cells: tuple[tuple[int, ...], ...]


def coverage(target: Target, size: tuple[int, int], views: Sequence[SeenPoints]) -> Coverage:
    """Measure how `views` of a target cover a picture of `size` (width, height); poses without points count not."""
    views = [view for view in views if len(view.ids)]
    cells = np.zeros((ROWS, COLUMNS), dtype=np.int64)
    shapes = []
    for view in views:
        cells += _counts(view.pixels, size)
        shapes.append(_shape(target, size, view))
    lowest, highest = np.zeros(5), np.zeros(5)
    if shapes:
        lowest, highest = np.min(shapes, axis=0), np.max(shapes, axis=0)
    lowest[2:] = 0.0  # a large and an oblique view tell something alone
    enough = [ENOUGH_X, ENOUGH_Y, ENOUGH_SIZE, ENOUGH_SKEW]
    x, y, large, skew = np.minimum((highest - lowest)[:4] / enough, 1.0).tolist()
    rows = tuple(tuple(row) for row in cells.tolist())
    return Coverage(len(views), x, y, large, skew, float(highest[4]), float((cells > 0).mean()), rows)


def missing_in_words(coverage: Coverage) -> list[str]:
    """Say what views to add; nothing where they are as different as they should be."""
    if coverage.views == 0:
        return ["no view shows the target"]
    sentences = []
    blocks = np.array(coverage.cells).reshape(3, ROWS // 3, 3, COLUMNS // 3).sum(axis=(1, 3))
    empty = [PLACES[row][column] for row, column in np.argwhere(blocks == 0)]
    if empty:
        sentences.append(
            f"no view shows the target in the {_listed(empty)} of the picture: what the lens does there is not seen"
        )
    if coverage.size < LEAST_SIZE:
        share = (coverage.size * ENOUGH_SIZE) ** 2
        sentences.append(
            f"the target is small in all views, {100 * share:.0f} % of the picture at most: take some from nearer"
        )
    if coverage.lean < LEAST_LEAN:
        sentences.append(
            f"the target leans by {degrees(coverage.lean):.0f} deg at most, which hardly tells focal length from "
            "distance: lean it by 20 to 45 deg"
        )
    return sentences


def _counts(pixels: Array, size: tuple[int, int]) -> NDArray[np.int64]:
    """Count the points (n, 2) in each cell (ROWS, COLUMNS) of the picture."""
    column, row = np.floor((pixels + 0.5) / size * [COLUMNS, ROWS]).astype(np.int64).T
    inside = (column >= 0) & (column < COLUMNS) & (row >= 0) & (row < ROWS)
    counts = np.bincount((row * COLUMNS + column)[inside], minlength=ROWS * COLUMNS)
    return counts.reshape(ROWS, COLUMNS)


def _shape(target: Target, size: tuple[int, int], view: SeenPoints) -> tuple[float, ...]:
    """Return where the target's middle is, from 0 to 1 each way, how large it is, its skew and its lean."""
    width, height = size
    hull = cv2.convexHull(view.pixels.astype(np.float32))
    area = float(cv2.contourArea(hull))
    room = np.array([width, height]) - sqrt(area)
    middle = view.pixels.mean(axis=0) - sqrt(area) / 2
    x, y = np.clip(middle / np.maximum(room, 1.0), 0.0, 1.0).tolist()
    points = target_points(target)[:, :2]
    found = points[view.ids]
    plane = view_of_plane(found, view.pixels)
    skew, lean = (0.0, 0.0) if plane is None else (_skew(plane, points), tilt_of(plane, found.mean(axis=0)))
    return x, y, sqrt(area / (width * height)), skew, lean


def _skew(plane: PlaneView, points: Array) -> float:
    """Return twice the angle (rad) by which the target's top right corner is off a right one, 1 at most."""
    (left, top), (right, bottom) = points.min(axis=0), points.max(axis=0)
    corners = plane.project(np.array([[left, top], [right, top], [right, bottom]]))
    a, b = corners[0] - corners[1], corners[2] - corners[1]
    sine = abs(float(a @ b)) / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-300)
    return min(1.0, 2 * float(np.arcsin(min(sine, 1.0))))


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
