"""How the sides of tags lie in the picture, and how the cells behind their borders do."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from calib.targets import AprilGrid, marker_cells, marker_dictionary

Floats = NDArray[np.float64]

SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
BEFORE, AFTER = [3, 0, 1, 2], [1, 2, 3, 0]
ALONG = SQUARE[AFTER] - SQUARE
INSIDE = np.stack([-ALONG[:, 1], ALONG[:, 0]], axis=-1)


@dataclass(frozen=True, eq=False)
class Sides:
    """The four sides of n tags, each from one of the `corners` (n, 4, 2) to the next, clockwise.

    `normals` (n, 4, 2) are unit vectors to the tag's inside and `lengths` (n, 4) are in px. A place is told by its
    height above the straight line from corner to corner, px to the inside, and by where it is along it, -1 to 1.

    White cells may begin at `depths` (n, 4, 2) px, at the start and at the end of the side. Of the cells nearest to it,
    the borders with the next ones are at `borders` (n, 4, c) along it, which grow by `leans` (n, 4, c) with each px of
    height; `jumps` (n, 4, c) are 1 where white begins, -1 where it ends and 0 else. To the outside there is nothing but
    paper up to `gaps` (n, 4) px.
    """

    corners: Floats
    normals: Floats
    lengths: Floats
    depths: Floats
    borders: Floats
    leans: Floats
    jumps: Floats
    gaps: Floats


def sides_of(target: AprilGrid, tags: NDArray[np.int64], corners: Floats) -> Sides:
    """Say how the sides of tags (n,) lie whose corners (n, 4, 2) are at these pixels."""
    chords = corners[:, AFTER] - corners
    lengths = np.sqrt((chords * chords).sum(axis=-1))
    directions = chords / lengths[..., None]
    normals = np.stack([-directions[..., 1], directions[..., 0]], axis=-1)

    off = _in_picture(corners, _places(target)) - corners[:, :, None]
    heights = (off @ normals[..., None])[..., 0]
    along = (off @ directions[..., None])[..., 0] * (2 / lengths[..., None]) - 1
    cells = marker_cells(target.dictionary) + 1
    upper, lower = along[..., 1 : cells - 1], along[..., cells + 1 : -2]
    rise = heights[..., cells:-1].mean(axis=-1) - heights[..., :cells].mean(axis=-1)
    return Sides(
        corners=corners,
        normals=normals,
        lengths=lengths,
        depths=heights[..., [0, cells - 1]],
        borders=upper,
        leans=(lower - upper) / rise[..., None],
        jumps=_jumps(target)[tags],
        gaps=-heights[..., -1],
    )


@lru_cache(maxsize=8)
def _places(target: AprilGrid) -> Floats:
    """List the places (4, q, 2) in a tag, of side 1, that tell how it is seen next to its sides.

    They are the ends of the borders between the outermost cells, beginning and ending with the black border's own
    ones; the other ends of the same; and the middle of the side, where the next tag begins.
    """
    cells = marker_cells(target.dictionary)
    along = np.arange(cells + 1)[:, None] / cells * ALONG[:, None]
    ends = [SQUARE[:, None] + depth / cells * INSIDE[:, None] + along for depth in (1, 2)]
    next_tag = SQUARE + ALONG / 2 - target.spacing / target.tag * INSIDE
    return np.concatenate([*ends, next_tag[:, None]], axis=1)


@lru_cache(maxsize=8)
def _jumps(target: AprilGrid) -> Floats:
    """List where white begins and ends (tags, 4, c) among the outermost cells along all tags' sides."""
    dictionary = marker_dictionary(target.dictionary)
    size, tags = dictionary.markerSize, target.rows * target.columns
    bits = np.array(
        [dictionary.getBitsFromByteList(dictionary.bytesList[tag : tag + 1], size) for tag in range(tags)]
    )
    rows = np.stack([np.rot90(bits, turns, axes=(1, 2))[:, 0] for turns in range(4)], axis=1)
    return np.diff(np.pad(rows, ((0, 0), (0, 0), (1, 1))).astype(np.float64))


def _in_picture(corners: Floats, places: Floats) -> Floats:
    """Map places (4, q, 2) of the unit square to its pictures (n, 4, q, 2), which have these corners (n, 4, 2)."""
    first, second, third, fourth = np.moveaxis(corners, 1, 0)
    one, other, uneven = second - third, fourth - third, first - second + third - fourth
    area = _cross(one, other)
    g, h = (_cross(uneven, other) / area)[:, None], (_cross(one, uneven) / area)[:, None]
    along_x, along_y = second - first + g * second, fourth - first + h * fourth
    along_x, along_y, first, g, h = (part[:, None, None] for part in (along_x, along_y, first, g, h))
    x, y = places[..., :1], places[..., 1:]
    return np.asarray((along_x * x + along_y * y + first) / (g * x + h * y + 1))


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
