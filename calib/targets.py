"""The printed targets: their points, where those are in the world, and which turns leave the print as it was.

The world is the target's own frame: X along columns, Y along rows, Z = X x Y pointing away from a camera that
looks at the printed side, so every point has Z = 0. The models are the `target` object of a session file and
of a profile; lengths are in metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Annotated, Any, Literal, Self, assert_never

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Deviation = Annotated[float, Field(ge=0, allow_inf_nan=False)]
MOST_ROWS = 1000


class _Print(BaseModel):
    """What every target has in common: it never changes, and keys it does not know are kept."""

    model_config = ConfigDict(frozen=True, extra="allow", strict=True, defer_build=True)


class _ScaledPrint(_Print):
    """A target with points on it.

    `pitch_std` is the standard deviation (m) of `pitch`, for a print whose scale was measured: the whole
    print is larger or smaller by the same factor, known to pitch_std / pitch. None takes the print for exact.
    """

    pitch_std: Deviation | None = None


class NoTarget(_Print):
    """No print at all: every view carries a camera pose that another system estimated."""

    kind: Literal["none"] = "none"


class CircleGrid(_ScaledPrint):
    """Disks in rows and columns, their centres `pitch` apart both ways. id = row * columns + column."""

    kind: Literal["circle_grid"] = "circle_grid"
    rows: int = Field(ge=2, le=MOST_ROWS)
    columns: int = Field(ge=2, le=MOST_ROWS)
    pitch: Length
    disk_diameter: Length

    @property
    def spacing(self) -> float:
        """Distance between the centres of nearest disks, in metres."""
        return self.pitch

    @model_validator(mode="after")
    def _disks_stand_apart(self) -> Self:
        _require_smaller("disk_diameter", self.disk_diameter, "pitch", self.pitch)
        return self


class AsymmetricCircleGrid(_ScaledPrint):
    """Disks in rows of which every second one is shifted by half a pitch (OpenCV's asymmetric circle grid).

    `pitch` is the spacing along a row's own disks; rows are half a pitch apart. The disk in row r and column
    c has its centre at x = (2 c + r mod 2) pitch / 2, y = r pitch / 2, and id = row * columns + column.
    OpenCV finds no such grid of fewer than 4 rows.
    """

    kind: Literal["asymmetric_circle_grid"] = "asymmetric_circle_grid"
    rows: int = Field(ge=4, le=MOST_ROWS)
    columns: int = Field(ge=2, le=MOST_ROWS)
    pitch: Length
    disk_diameter: Length

    @property
    def spacing(self) -> float:
        """Distance between the centres of nearest disks, in metres: along a diagonal."""
        return self.pitch / sqrt(2)

    @model_validator(mode="after")
    def _disks_stand_apart(self) -> Self:
        _require_smaller(
            "disk_diameter", self.disk_diameter, "the diagonal spacing pitch / sqrt(2)", self.spacing
        )
        return self


class Chessboard(_ScaledPrint):
    """Inner corners of a chessboard whose squares have the side `pitch`. id = row * columns + column.

    The square up and left of corner (0, 0), outside the grid of corners, is black, and so is the one down and
    right of it: OpenCV's pattern. A board where rows + columns is even, printed the other way round, is taken
    as it is.
    """

    kind: Literal["chessboard"] = "chessboard"
    rows: int = Field(ge=3, le=MOST_ROWS)
    columns: int = Field(ge=3, le=MOST_ROWS)
    pitch: Length


class Charuco(_ScaledPrint):
    """A chessboard of rows x columns squares of side `pitch`, each white one with a marker of side `marker`.

    Ids are OpenCV's: the inner corners row by row. The origin is inner corner 0, one square in from the
    board's edges. The first square, top left, is black (OpenCV's pattern since 4.6, not its legacy pattern).
    """

    kind: Literal["charuco"] = "charuco"
    rows: int = Field(ge=3, le=MOST_ROWS)
    columns: int = Field(ge=3, le=MOST_ROWS)
    pitch: Length
    marker: Length
    dictionary: str

    @field_validator("dictionary")
    @classmethod
    def _dictionary_is_known(cls, name: str) -> str:
        _dictionary_size(name)
        return name

    @model_validator(mode="after")
    def _markers_fit(self) -> Self:
        _require_smaller("marker", self.marker, "pitch", self.pitch)
        _require_markers(self.rows * self.columns // 2, self.dictionary)
        return self


class AprilGrid(_ScaledPrint):
    """Rows x columns of square tags of side `tag`, neighbours separated by a gap of `spacing`.

    Tags are numbered row by row from the top left; the points are their black borders' outer corners, id = 4
    * tag + corner, in OpenCV's order: top left, top right, bottom right, bottom left. The origin is corner 0
    of tag 0.
    """

    kind: Literal["aprilgrid"] = "aprilgrid"
    rows: int = Field(ge=1, le=MOST_ROWS)
    columns: int = Field(ge=1, le=MOST_ROWS)
    tag: Length
    spacing: Length
    dictionary: str = "DICT_APRILTAG_36h11"

    @property
    def pitch(self) -> float:
        """Distance from a tag to the same place on the next one, in metres; what `pitch_std` belongs to."""
        return self.tag + self.spacing

    @field_validator("dictionary")
    @classmethod
    def _dictionary_is_known(cls, name: str) -> str:
        _dictionary_size(name)
        return name

    @model_validator(mode="after")
    def _tags_are_enough(self) -> Self:
        _require_markers(self.rows * self.columns, self.dictionary)
        return self


Target = Annotated[
    NoTarget | CircleGrid | AsymmetricCircleGrid | Chessboard | Charuco | AprilGrid,
    Field(discriminator="kind"),
]


@dataclass(frozen=True, eq=False)
class TargetSymmetry:
    """A turn of the target in its plane that leaves the print as it was, so that it can be read in two ways.

    The point that the turned reading labels i is the point `permutation[i]` (n,) of the original one, so
    pixels listed by id become `pixels[permutation]`, and `turned_from_world @ points[permutation[i]] ==
    points[i]`: a camera at `world_from_camera` in the original reading is at `turned_from_world @
    world_from_camera` (4, 4; metres) in the turned one.
    """

    permutation: NDArray[np.int64]
    turned_from_world: NDArray[np.float64]


def disk_diameter(target: Target) -> float | None:
    """Return the diameter (m) of the target's disks, None where it has none."""
    return target.disk_diameter if isinstance(target, CircleGrid | AsymmetricCircleGrid) else None


def target_points(target: Target) -> NDArray[np.float64]:
    """Return the world coordinates (n, 3), in metres, of the target's points by id; none for `NoTarget`."""
    match target:
        case NoTarget():
            return np.empty((0, 3))
        case CircleGrid() | Chessboard():
            column, row = _lattice(target.rows, target.columns)
            return _in_plane(column * target.pitch, row * target.pitch)
        case AsymmetricCircleGrid():
            column, row = _lattice(target.rows, target.columns)
            return _in_plane((2 * column + row % 2) * target.pitch / 2, row * target.pitch / 2)
        case Charuco():
            column, row = _lattice(target.rows - 1, target.columns - 1)
            return _in_plane(column * target.pitch, row * target.pitch)
        case AprilGrid():
            column, row = _lattice(target.rows, target.columns)
            right, down = np.array([0, 1, 1, 0]), np.array([0, 0, 1, 1])
            return _in_plane(
                (column[:, None] * target.pitch + right * target.tag).ravel(),
                (row[:, None] * target.pitch + down * target.tag).ravel(),
            )
        case _:
            assert_never(target)


def target_symmetries(target: Target) -> tuple[TargetSymmetry, ...]:
    """List the rotations, other than none, after which the print looks the same.

    A circle grid has the half turn, and the quarter turns where it is square. A chessboard has those of them
    that put black on black: the half turn where rows + columns is even, the quarter turns where it is square
    and rows is even. An asymmetric circle grid has the half turn where it has an even number of rows. Printed
    ids leave no choice.
    """
    quarter_turns: tuple[int, ...]
    match target:
        case CircleGrid():
            quarter_turns = (1, 2, 3) if target.rows == target.columns else (2,)
        case Chessboard():
            square = target.rows == target.columns
            quarter_turns = (1, 2, 3) if square and target.rows % 2 == 0 else (2,)
            if (target.rows + target.columns) % 2:
                quarter_turns = ()
        case AsymmetricCircleGrid():
            quarter_turns = () if target.rows % 2 else (2,)
        case NoTarget() | Charuco() | AprilGrid():
            return ()
        case _:
            assert_never(target)
    points = target_points(target)
    ids = np.arange(len(points), dtype=np.int64).reshape(target.rows, target.columns)
    return tuple(_turn(points, np.rot90(ids, turns).ravel(), turns) for turns in quarter_turns)


def _turn(points: NDArray[np.float64], permutation: NDArray[np.int64], quarter_turns: int) -> TargetSymmetry:
    """Describe the reading whose axes are the world's, turned about Z by so many quarter turns."""
    cosine, sine = [(1, 0), (0, 1), (-1, 0), (0, -1)][quarter_turns]
    turned_from_world = np.eye(4)
    turned_from_world[:2, :2] = [[cosine, sine], [-sine, cosine]]
    turned_from_world[:3, 3] = -turned_from_world[:3, :3] @ points[permutation[0]]
    return TargetSymmetry(permutation, turned_from_world)


def _lattice(rows: int, columns: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Column and row (rows * columns,) of each id."""
    row, column = np.divmod(np.arange(rows * columns, dtype=np.int64), columns)
    return column, row


def _in_plane(x: NDArray[np.floating], y: NDArray[np.floating]) -> NDArray[np.float64]:
    return np.column_stack([x, y, np.zeros(len(x))])


def _require_smaller(name: str, value: float, limit_name: str, limit: float) -> None:
    if value >= limit:
        raise ValueError(f"{name} ({value:g} m) must be smaller than {limit_name} ({limit:g} m)")


def marker_dictionary(name: str) -> cv2.aruco.Dictionary:
    """Return OpenCV's dictionary of markers with this name."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


def marker_cells(dictionary: str) -> int:
    """Return how many cells a side of a dictionary's markers has, the black border's included."""
    return marker_dictionary(dictionary).markerSize + 2


def _dictionary_size(name: str) -> int:
    """How many markers the dictionary of OpenCV with this name has."""
    number: Any = getattr(cv2.aruco, name, None) if name.startswith("DICT_") else None
    if number is None:
        raise ValueError(
            f"{name!r} is not a marker dictionary of OpenCV, as DICT_5X5_100 and DICT_APRILTAG_36h11 are"
        )
    return len(marker_dictionary(name).bytesList)


def _require_markers(needed: int, dictionary: str) -> None:
    size = _dictionary_size(dictionary)
    if needed > size:
        raise ValueError(
            f"{dictionary} has {size} markers and the target needs {needed}: choose a larger dictionary"
        )
