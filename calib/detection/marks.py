"""What is to be seen where a target's points are: places of ink, of paper, and the edges between them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import pi, sqrt
from typing import assert_never

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.lattice import Lattice, lattice_of
from calib.errors import DetectionError
from calib.targets import (
    AprilGrid,
    AsymmetricCircleGrid,
    Charuco,
    Chessboard,
    CircleGrid,
    NoTarget,
    Target,
    marker_cells,
    target_points,
)

Array = NDArray[np.float64]

INK, PAPER = -1, 1
KEPT_CLEAR = 0.85  # of what is free of other things
CORE = 0.5  # of a disk's radius
RAYS = 8
IN_SQUARES, ALONG_ARMS, CLEAR_IN_SQUARE = (0.1, 0.2, 0.32), (0.22, 0.36), 0.2  # of the pitch
IN_MARGIN = 0.6  # of the white round a marker
WRONG, WRONG_OF_CELLS = (
    1,
    3,
)  # samples of a mark, at most; of a tag none more, whose covered corner pulls the others
ON_SIDES = 6  # places on each of a tag's sides
ARMS = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
QUADRANTS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])


@dataclass(frozen=True, eq=False)
class Marks:
    """The m marks of a target: its disks, its corners with what is round them, or its tags. All is in m.

    A mark is at `middles` (m, 2), and tells the points of the ids `points` (m, q), at `positions` (m, q, 2). Across
    edges at `edges` (m, j, 2), along unit vectors `outwards` (m, j, 2) from ink to paper, there is nothing else for
    `clear` to both sides. The nearest marks are `spacing` apart.

    At `samples` (m + b, k, 2) there is ink or paper, by `colours` (m + b, k); `wrong` of a mark's may look otherwise.
    With `either_way`, ink and paper may be exchanged. Marks that nothing but their places tells apart are on a
    `lattice`, which goes on beyond the rim: the last b rows are what there would be to see if marks were there, too.
    `nearest` (m + b,) are the numbers of the marks themselves, and then of those next to the places beyond.
    """

    points: NDArray[np.int64]
    positions: Array
    middles: Array
    edges: Array
    outwards: Array
    clear: float
    spacing: float
    samples: Array
    colours: NDArray[np.float32]
    nearest: NDArray[np.int64]
    either_way: bool
    wrong: int = WRONG
    lattice: Lattice | None = None

    @cached_property
    def places(self) -> Array:
        """All places (n, 2), one after the other: points, samples, edges, and as far from the edges as is clear."""
        parts = self.positions, self.samples, self.edges, self.edges + self.clear * self.outwards
        return np.concatenate([part.reshape(-1, 2) for part in parts])

    @cached_property
    def owners(self) -> NDArray[np.int64]:
        """The mark (n,) that each of the places belongs to, or is next to."""
        own = np.arange(len(self.middles))
        rows = (own, self.positions), (self.nearest, self.samples), (own, self.edges), (own, self.edges)
        return np.concatenate([np.repeat(marks, part.shape[1]) for marks, part in rows])

    @cached_property
    def agreeing(self) -> float:
        """The least part of a mark's samples that have the right colour."""
        return 1 - self.wrong / int(self.colours.shape[1])

    @cached_property
    def paper(self) -> NDArray[np.float32]:
        """Weights (m + b, k) for the mean of the samples where there is paper."""
        return _weights(self.colours == PAPER)

    @cached_property
    def ink(self) -> NDArray[np.float32]:
        """Weights (m + b, k) for the mean of the samples where there is ink."""
        return _weights(self.colours == INK)

    def on_lattice(self, lattice: Lattice, *, alternating: bool) -> Marks:
        """Return these marks with what would be beyond the rim: of the other colours next to each, or of the same."""
        nearest = lattice.nearest
        colours = -self.colours[nearest] if alternating else self.colours[nearest]
        return replace(
            self,
            samples=np.concatenate([self.samples, self.samples[nearest] + lattice.steps_beyond[:, None]]),
            colours=np.concatenate([self.colours, colours]),
            nearest=np.concatenate([self.nearest, nearest]),
            lattice=lattice,
        )


@lru_cache(maxsize=8)
def marks_of(target: Target) -> Marks:
    """List the marks of a target; raises DetectionError where it has none."""
    match target:
        case NoTarget():
            raise DetectionError("this session has no target to track: its views carry camera poses")
        case CircleGrid() | AsymmetricCircleGrid():
            return _disks(target).on_lattice(lattice_of(target), alternating=False)
        case Chessboard():
            return _corners(target).on_lattice(lattice_of(target), alternating=True)
        case Charuco():
            return _numbered_corners(target)
        case AprilGrid():
            return _tags(target)
        case _:
            assert_never(target)


def _disks(target: CircleGrid | AsymmetricCircleGrid) -> Marks:
    middles = target_points(target)[:, None, :2]
    radius, half_way = target.disk_diameter / 2, target.spacing / 2
    core = np.concatenate([np.zeros((1, 2)), CORE * radius * ARMS])
    rim = (radius + half_way) / 2 * np.concatenate([ARMS, QUADRANTS / sqrt(2)])
    angles = 2 * pi * np.arange(RAYS) / RAYS
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    return Marks(
        points=np.arange(len(middles))[:, None],
        positions=middles,
        middles=middles[:, 0],
        samples=middles + np.concatenate([core, rim]),
        colours=np.tile(np.repeat([INK, PAPER], [len(core), len(rim)]), (len(middles), 1)).astype(np.float32),
        edges=middles + radius * rays,
        outwards=np.tile(rays, (len(middles), 1, 1)),
        clear=KEPT_CLEAR * min(radius, half_way - radius),
        spacing=target.spacing,
        nearest=np.arange(len(middles)),
        either_way=True,
    )


def _corners(target: Chessboard | Charuco) -> Marks:
    middles = target_points(target)[:, None, :2]
    columns = target.columns if isinstance(target, Chessboard) else target.columns - 1
    row, column = np.divmod(np.arange(len(middles)), columns)
    # The squares up and left of corner (0, 0), and down and right, are black.
    turns = np.where((row + column) % 2, -1.0, 1.0)
    squares = np.concatenate([place * QUADRANTS for place in IN_SQUARES])
    colours = turns[:, None] * -np.sign(squares.prod(axis=1))
    along = np.repeat(ARMS, len(ALONG_ARMS), axis=0)
    places = np.tile(ALONG_ARMS, len(ARMS))[:, None] * along
    return Marks(
        points=np.arange(len(middles))[:, None],
        positions=middles,
        middles=middles[:, 0],
        samples=middles + squares * target.pitch,
        colours=colours.astype(np.float32),
        edges=middles + target.pitch * places,
        outwards=turns[:, None, None] * -along[:, ::-1],
        clear=CLEAR_IN_SQUARE * target.pitch,
        spacing=target.pitch,
        nearest=np.arange(len(middles)),
        either_way=isinstance(target, Chessboard) and (target.rows + target.columns) % 2 == 0,
    )


def _numbered_corners(target: Charuco) -> Marks:
    """Corners with the markers in both of the white squares at each."""
    corners = _corners(target)
    row, column = np.divmod(np.arange(target.rows * target.columns), target.columns)
    white = (row + column) % 2 == 1
    number = np.cumsum(white) - 1
    margin = (target.pitch - target.marker) / 2
    cells, drawn = _cells(target.dictionary, int(white.sum()), target.marker)
    squares = np.column_stack([column, row]) - 1.0

    first_row, first_column = np.divmod(np.arange(len(corners.middles)), target.columns - 1)
    first = first_row * target.columns + first_column
    around = first[:, None] + [0, 1, target.columns, target.columns + 1]
    markers = around[white[around]].reshape(-1, 2)
    inner = slice(1, -1)
    places = squares[markers][:, :, None, None] * target.pitch + margin + cells[inner, inner]
    bits = drawn[number[markers]][:, :, inner, inner]

    middles = corners.middles[:, None]
    # In white squares the markers are in the way further out.
    narrow = np.where(corners.colours == PAPER, IN_MARGIN * margin / (IN_SQUARES[-1] * target.pitch), 1.0)
    squares = middles + narrow[..., None] * (corners.samples - middles)
    return replace(
        corners,
        samples=np.concatenate([squares, places.reshape(len(middles), -1, 2)], axis=1),
        colours=np.concatenate([corners.colours, bits.reshape(len(middles), -1)], axis=1),
        clear=KEPT_CLEAR * margin,
        wrong=WRONG_OF_CELLS,
    )


def _tags(target: AprilGrid) -> Marks:
    points = target_points(target)[:, :2].reshape(-1, 4, 2)
    cells, drawn = _cells(target.dictionary, len(points), target.tag)
    cell = target.tag / len(cells)
    white = min(target.spacing, cell)
    first = points[:, :1]
    # Along the sides, clockwise from the top left.
    places = (np.arange(ON_SIDES) + 0.5) / ON_SIDES * target.tag
    starts = np.repeat(target.tag * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), ON_SIDES, axis=0)
    sides = starts + np.tile(places, 4)[:, None] * np.repeat(ARMS, ON_SIDES, axis=0)
    outwards = np.repeat(np.roll(ARMS, 1, axis=0), ON_SIDES, axis=0)
    samples = np.concatenate([cells.reshape(-1, 2), sides + white / 2 * outwards])
    paper = np.full((len(points), len(sides)), PAPER, dtype=np.float32)
    return Marks(
        points=np.arange(4 * len(points)).reshape(-1, 4),
        positions=points,
        middles=points.mean(axis=1),
        samples=first + samples,
        colours=np.concatenate([drawn.reshape(len(points), -1), paper], axis=1),
        edges=first + sides,
        outwards=np.tile(outwards, (len(points), 1, 1)),
        clear=KEPT_CLEAR * white,
        spacing=target.pitch,
        nearest=np.arange(len(points)),
        either_way=False,
    )


def _cells(dictionary: str, count: int, side: float) -> tuple[Array, NDArray[np.float32]]:
    """Give the cells of markers: their middles (c, c, 2), the top left corner at (0, 0), and colours (count, c, c)."""
    markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    cells = marker_cells(dictionary)
    drawn = [cv2.aruco.generateImageMarker(markers, number, cells) for number in range(count)]
    middles = (np.arange(cells) + 0.5) * side / cells
    places = np.stack(np.meshgrid(middles, middles), axis=-1)
    return places, np.where(np.array(drawn), PAPER, INK).astype(np.float32)


def _weights(of_them: NDArray[np.bool_]) -> NDArray[np.float32]:
    weights: NDArray[np.float32] = (of_them / of_them.sum(axis=1, keepdims=True)).astype(np.float32)
    return weights
