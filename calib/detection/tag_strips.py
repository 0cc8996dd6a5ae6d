"""The pixels along the sides of tags."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.detection.picture import Picture
from calib.detection.pixel_edge import PIXEL_VARIANCE, blurred_step, density
from calib.detection.tag_sides import AFTER, BEFORE, Floats, Sides

Singles = NDArray[np.float32]

SHOWN = 3.0  # standard deviations of the blur: nothing is seen of an edge that is further away
ROUNDED = (
    2.0  # standard deviations; further from the next side, its rounding of the corner pulls less than noise
)
LEVELS = 1.5  # px beyond that, which tell how white it is and how black
SHORTEST_REACH = 1.0  # px
BORDER = 0.8  # of its width; beyond, the pixels tell of the cells
MOST_CUT = 0.3  # of a side, at either end


@dataclass(frozen=True, eq=False)
class Cells:
    """The k pixels of strips that see white cells behind the border: of each its `side` (k,) and its place `at` (k,).

    The places count all pixels of all sides, one after the other. The cells begin at `depths` (k,) px, and as much as
    `white` (k,) of their row is seen to be white there.
    """

    side: NDArray[np.int64]
    at: NDArray[np.int64]
    depths: Singles
    white: Singles


@dataclass(frozen=True, eq=False)
class Strips:
    """The m pixels along each of s sides, and their grey `values`; all of them (s, m).

    `heights` and `along` are places as `Sides` has them; `x` and `y` are in sizes of the tag, from its middle. Those
    with `used` 0 fill up the rows and count for nothing.
    """

    heights: Singles
    along: Singles
    x: Singles
    y: Singles
    values: Singles
    used: Singles
    cells: Cells


def strips_along(picture: Picture, sides: Sides, blur: float, unknown: Floats, lines: int) -> Strips:
    """Take the pixels that tell of sides known to `unknown` (n, 4) px, seen with such a blur (px).

    They are up to so many lines of pixels, along x or y, whichever crosses a side more steeply: nothing is
    interpolated. The ends are left out, where blur makes the corner round, and so is what is beyond the black
    border or the white gap. Pixels out of the picture do not count.
    """
    reach = SHOWN * blur + LEVELS + unknown
    outside = np.clip(sides.gaps - SHOWN * blur, SHORTEST_REACH, reach)
    inside = np.clip(BORDER * sides.depths.min(axis=-1), SHORTEST_REACH, reach)
    first, last = _clear_parts(sides, ROUNDED * blur + unknown, np.maximum(inside, outside))

    # Right and down are x and y for sides that lie, y and x for steep ones.
    steep = np.abs(sides.normals[..., :1]) > np.abs(sides.normals[..., 1:])
    order = np.where(steep, [1, 0], [0, 1])
    start, normal, direction = (
        np.take_along_axis(part, order, axis=-1)
        for part in (sides.corners, sides.normals, sides.normals[..., ::-1] * [1, -1])
    )
    ends = start[..., :1] + np.stack([first, last], axis=-1) * (sides.lengths * direction[..., 0])[..., None]
    low, high = np.ceil(ends.min(axis=-1)), np.floor(ends.max(axis=-1))
    stride = np.ceil((np.maximum(high - low, 0) + 1) / lines)
    count = int((np.maximum(high - low, 0) / stride).max(initial=0)) + 1
    right = low[..., None] + stride[..., None] * np.arange(count)
    off_right = right - start[..., :1]
    middle = ((inside - outside)[..., None] / 2 - normal[..., :1] * off_right) / normal[..., 1:]
    down = np.rint(start[..., 1:] + middle)
    off_down = down - start[..., 1:]
    half = int(((inside + outside) / 2 / np.abs(normal[..., 1])).max(initial=0) + 0.5)
    across = np.arange(-half, half + 1, dtype=np.int32)[:, None]

    def over_pixels(by_right: Floats, by_down: Floats) -> Singles:
        """Give what grows by so much (n, 4) with each px right and down, and is 0 at the sides' starts."""
        at_lines = by_right[..., None] * off_right + by_down[..., None] * off_down
        steps = by_down[..., None, None] * across
        grown = at_lines.astype(np.float32)[..., None, :] + steps.astype(np.float32)
        return np.asarray(grown.reshape(by_right.size, -1))

    heights = over_pixels(normal[..., 0], normal[..., 1])
    turns = 2 * direction / sides.lengths[..., None]
    along = over_pixels(turns[..., 0], turns[..., 1]) - 1
    sizes = sides.lengths.mean(axis=1)[:, None]
    from_middle = (sides.corners - sides.corners.mean(axis=1)[:, None]) / sizes[..., None]
    x, y = (
        over_pixels((order[..., 0] == axis) / sizes, (order[..., 1] == axis) / sizes)
        + _column(from_middle[..., axis])
        for axis in range(2)
    )

    size = np.array(picture.values.shape[::-1])[order]
    on_lines = (right >= 0) & (right < size[..., :1]) & (right <= high[..., None])
    down_to = down.astype(np.int32)[..., None, :] + across
    seen = (down_to >= 0) & (down_to < size.astype(np.int32)[..., 1:, None]) & on_lines[..., None, :]
    used = seen.reshape(heights.shape)
    used &= (heights <= _column(inside)) & (heights >= _column(-outside))
    used &= (along >= _column(2 * first - 1)) & (along <= _column(2 * last - 1))
    strides = np.array([1, picture.values.shape[1]])[order]
    index = (right * strides[..., :1] + down * strides[..., 1:]).astype(np.intp)[..., None, :]
    index = index + strides[..., 1:, None] * across
    # What is out of the picture is not used, whatever is taken for it.
    values = picture.values.take(index, mode="clip").astype(np.float32).reshape(heights.shape)
    cells = _cells_seen(sides, heights, along, used, blur)
    return Strips(heights, along, x, y, values, used.astype(np.float32), cells)


def _clear_parts(sides: Sides, kept_off: Floats, reach: Floats) -> tuple[Floats, Floats]:
    """Give from which to which part (n, 4) of sides all pixels within reach are so far off the next sides (px)."""
    cosine = np.abs((sides.normals * sides.normals[:, BEFORE]).sum(axis=-1))
    sine = np.sqrt(np.maximum(1 - cosine**2, 0.01))
    cut = (kept_off + cosine * reach) / sine
    return np.minimum(cut / sides.lengths, MOST_CUT), 1 - np.minimum(cut[:, AFTER] / sides.lengths, MOST_CUT)


def _cells_seen(
    sides: Sides, heights: Singles, along: Singles, used: NDArray[np.bool_], blur: float
) -> Cells:
    """Find the pixels (s, m) in which blur lets the cells be seen, and how white their row is there.

    Where borders between cells lean, they are taken where they are at the mean height of what is seen of them.
    """
    blurred = np.float32(np.sqrt(blur**2 + PIXEL_VARIANCE))
    start, end = (_column(sides.depths[..., which]) for which in range(2))
    above = heights - ((start + end) / 2 + (end - start) / 2 * along)
    at = np.flatnonzero(used & (above > -SHOWN * blurred))
    side = at // heights.shape[1]
    off = np.asarray(above.take(at), dtype=np.float32)
    scaled: Singles = np.asarray(off / blurred, dtype=np.float32)
    seen_at = off + blurred * density(scaled) / np.maximum(blurred_step(scaled), np.float32(1e-3))
    borders, leans, jumps = (
        part.reshape(len(heights), -1).astype(np.float32).take(side, axis=0)
        for part in (sides.borders, sides.leans, sides.jumps)
    )
    beyond = along.take(at)[:, None] - borders - leans * seen_at[:, None]
    beyond *= (_column(sides.lengths / 2) / blurred).take(side)[:, None]
    white = (blurred_step(beyond) * jumps).sum(axis=1)
    return Cells(side, at, heights.take(at) - off, white)


def _column(of_sides: Floats) -> Singles:
    """Take what each side has (n, 4) as a column (s, 1)."""
    return of_sides.reshape(-1, 1).astype(np.float32)
