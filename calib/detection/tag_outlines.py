"""Corners of tags, measured on the grey values along their borders' outer edges.

Blur rounds a corner off, and an operator that looks at the corner alone is pulled inwards, by 0.2 to 0.5 px under
common blur. Here the whole outline is drawn as blur leaves it, and its four corners are moved to fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from calib.detection.edge_profile import clear_width, correlated, profile
from calib.detection.grey_fit import Floats, Patches, Singles, fit_grey_values, patches_of
from calib.detection.picture import Picture
from calib.detection.strips import strips

MOST_MOVED = 0.1  # of a side; more is another thing
CELLS_REACH = 3.0  # standard deviations of the blur; they are on one side of the edge only, and pull
SAMPLES_A_CELL = 8  # of the colours along a side
LEAST_CONTRAST = 3.0  # times the noise
UNMODELLED_VARIANCE = (
    0.005**2
)  # px²; the shape of the pixels and of the lens' blur, and cells that blur into the border


@dataclass(frozen=True, eq=False)
class Outlines:
    """Roughly what n tags look like: `corners` (n, 4, 2), clockwise, px.

    `bows` (n, 4) are how far (px) to the inside the middle of each side, from one corner to the next, is off the
    straight line. `cells` (n, 4, c) are the colours along it of the cells next to the black border, from one end to the
    other with the border itself: 1 where they are white. Up to `clear` (n,) px to both sides there is nothing else.
    """

    corners: Floats
    bows: Floats
    cells: Floats
    clear: Floats


@dataclass(frozen=True, eq=False)
class TagCorners:
    """Tags' corners: `pixels` (n, 4, 2) and their `covariances` (n, 4, 2, 2) in px²; `found` (n,) tells which are.

    `blur` is the standard deviation of it, px.
    """

    pixels: Floats
    covariances: Floats
    found: NDArray[np.bool_]
    blur: float


def refine_tags(picture: Picture, outlines: Outlines, blur: float) -> TagCorners:
    """Move tags' corners to where their outlines fit the grey values, with about such a blur (px)."""
    n = len(outlines.corners)
    origins = outlines.corners.mean(axis=1)
    width = clear_width(blur, float(np.median(outlines.clear)), CELLS_REACH)
    patches = _patches(picture, outlines.corners, origins, width)
    start = np.column_stack([np.zeros((n, 8)), np.full(n, np.log(blur))])
    fit = fit_grey_values(picture, patches, partial(_square, patches, origins, outlines), start)

    sides = np.linalg.norm(outlines.corners - np.roll(outlines.corners, -1, axis=1), axis=2)
    moved = np.abs(fit.parameters[:, :8]).max(axis=1)
    found = fit.converged & (moved < np.maximum(MOST_MOVED * sides.min(axis=1), 2 * outlines.clear))
    found &= fit.steps < -LEAST_CONTRAST * picture.noise / 2
    corners = outlines.corners + fit.parameters[:, :8].reshape(n, 4, 2)
    # Where a corner is out of the picture there is a side without its end, or none.
    found &= ((corners > 0) & (corners < np.array(picture.values.shape[::-1]) - 1)).all(axis=(1, 2))
    of_corners = fit.covariances[:, :8, :8].reshape(n, 4, 2, 4, 2)
    covariances = np.stack([of_corners[:, corner, :, corner] for corner in range(4)], axis=1)
    return TagCorners(
        corners,
        covariances + UNMODELLED_VARIANCE * np.eye(2),
        found,
        float(np.exp(np.median(fit.parameters[found, 8]))) if found.any() else blur,
    )


def _patches(picture: Picture, near: Floats, origins: Floats, width: float) -> Patches:
    n = len(near)
    following = np.roll(near, -1, axis=1)
    pixels, wanted = strips(picture, near.reshape(-1, 2), following.reshape(-1, 2), width)
    pixels, wanted = pixels.reshape(n, 4, -1, 2), wanted.reshape(n, 4, -1)
    # Where the strips overlap, a pixel belongs to the side that it is nearest to.
    normals = inward_normals(near)
    distances = np.abs(
        np.einsum("nkc,nsqc->nksq", normals, pixels) - (normals * near).sum(axis=-1)[..., None, None]
    )
    wanted &= distances.argmin(axis=1) == np.arange(4)[:, None]
    return patches_of(picture, origins, pixels.reshape(n, -1, 2), wanted.reshape(n, -1))


def _square(
    patches: Patches, origins: Floats, outlines: Outlines, parameters: Floats
) -> tuple[Singles, Singles]:
    """Draw tags, 1 inside and -1 outside, of parameters (n, 9), and the derivatives (n, 9, m).

    The parameters are how far the corners are off, x and y one by one, and the blur's logarithm.
    """
    corners = outlines.corners + parameters[:, :8].reshape(-1, 4, 2)
    sides = _sides(patches, corners - origins[:, None], outlines.bows, np.exp(-parameters[:, 8]))
    drawn, steep = _black_square(sides)
    cells = _white_cells(sides, outlines.cells)
    steep -= cells.steep_across
    across = -2 * sides.scale * steep
    along = 2 / sides.lengths * cells.steep_along

    derivatives = np.empty((len(corners), 9, patches.x.shape[1]), dtype=np.float32)
    for axis, sign in ((0, 1), (1, -1)):
        moved = across * sides.normals[:, :, axis] + along * (sign * sides.normals[:, :, 1 - axis])
        by_end = moved * sides.fractions
        derivatives[:, axis:8:2] = moved - by_end + np.roll(by_end, 1, axis=1)
    derivatives[:, 8] = -2 * ((sides.heights * steep).sum(axis=1) + cells.of_borders)
    return 2 * (drawn - cells.drawn) - 1, derivatives


@dataclass(frozen=True, eq=False)
class _Sides:
    """The four sides of n tags, as seen from m pixels.

    `normals` (n, 4, 2, 1) point inwards, `lengths` (n, 4, 1) are in px, `scale` (n, 1, 1) is one over the blur.
    Pixels are `heights` (n, 4, m) above a side, over the blur, at `fractions` (n, 4, m) of it; the point in which
    the diagonals cross is at `middles` (n, 4, 1) above it.
    """

    normals: Singles
    lengths: Singles
    scale: Singles
    heights: Singles
    fractions: Singles
    middles: Singles


def _sides(patches: Patches, corners: Floats, bows: Floats, scale: Floats) -> _Sides:
    along = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(along, axis=-1)
    normals = inward_normals(corners)
    one, other, first = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1], along[:, 0]
    crossing = corners[:, 0] + (_cross(first, other) / _cross(one, other))[:, None] * one
    middles = ((crossing[:, None] - corners) * normals).sum(axis=-1) * scale[:, None]

    x, y = (corners[..., axis, None].astype(np.float32) for axis in range(2))
    off_x, off_y = patches.x[:, None] - x, patches.y[:, None] - y
    normal_x, normal_y = (normals[..., axis, None].astype(np.float32) for axis in range(2))
    fractions = (normal_y * off_x - normal_x * off_y) / lengths[..., None].astype(np.float32)
    bowed = (4 * bows)[..., None].astype(np.float32) * fractions * (1 - fractions)
    heights = scale[:, None, None].astype(np.float32) * (normal_x * off_x + normal_y * off_y - bowed)
    return _Sides(
        normals[..., None].astype(np.float32),
        lengths[..., None].astype(np.float32),
        scale[:, None, None].astype(np.float32),
        heights,
        fractions,
        middles[..., None].astype(np.float32),
    )


def _black_square(sides: _Sides) -> tuple[Singles, Singles]:
    """Draw squares without cells, 1 inside and 0 outside (n, m), and their derivatives by the heights (n, 4, m)."""
    levels, densities = profile(sides.heights)
    parts = np.asarray((1 + levels) / 2, dtype=np.float32)
    drawn = parts.prod(axis=1)
    before, after, opposite = (np.roll(parts, turn, axis=1) for turn in (1, -1, 2))
    steep = densities * before * after * opposite
    # Blur on corners that are not right angles; each is where its own side begins and the one before ends.
    rounding, (by_before, by_own) = correlated(
        (np.roll(sides.heights, 1, axis=1), sides.heights),
        (np.roll(densities, 1, axis=1), densities),
        (np.roll(sides.normals, 1, axis=1) * sides.normals).sum(axis=2),
    )
    return drawn + rounding.sum(axis=1), steep + by_own + np.roll(by_before, -1, axis=1)


@dataclass(frozen=True, eq=False)
class _Cells:
    """White cells inside the border, as blur lets them be seen near the sides.

    `drawn` (n, m) is 1 where they are; `steep_across` and `steep_along` (n, 4, m) are its derivatives by the height
    above each side and by the fraction of it; `of_borders` (n, m) is the derivative by the height, times the border's.
    """

    drawn: Singles
    steep_across: Singles
    steep_along: Singles
    of_borders: Singles


def _white_cells(sides: _Sides, cells: Floats) -> _Cells:
    """Draw the cells along the side that is nearest to each pixel.

    A place in the tag's own square follows from the distances to opposite sides, over those of its middle.
    """
    nearest = np.abs(sides.heights).argmin(axis=1)[:, None]
    ratios = sides.heights / sides.middles
    before, own, after, opposite = (
        np.take_along_axis(ratios, (nearest + turn) % 4, axis=1)[:, 0] for turn in (3, 0, 1, 2)
    )
    middle = np.take_along_axis(sides.middles, nearest, axis=1)[:, 0]
    border = middle * (own + opposite) / np.float32(cells.shape[2])
    level, density = profile(middle * own - border)
    part = np.asarray((1 + level) / 2, dtype=np.float32)

    blurred = _blurred_cells(cells, sides.lengths * sides.scale)
    samples = blurred.shape[2] - 1
    place = np.clip(before / np.maximum(before + after, 0.1) * samples, 0, samples - 1e-3)
    low = place.astype(np.intp)
    rows = np.arange(len(low))[:, None]
    here, next_to_it = (blurred[rows, nearest[:, 0], at] for at in (low, low + 1))
    rising: Singles = next_to_it - here
    white: Singles = here + (place - low).astype(np.float32) * rising
    on_side = nearest == np.arange(4)[:, None]
    return _Cells(
        white * part,
        on_side * (white * density)[:, None],
        on_side * (part * rising * np.float32(samples))[:, None],
        white * density * border,
    )


def _blurred_cells(cells: Floats, lengths: Singles) -> Singles:
    """Blur the colours (n, 4, c) along sides of so many deviations of the blur (n, 4, 1): (n, 4, 8 c + 1) of them."""
    count = cells.shape[2]
    places = np.linspace(0, 1, SAMPLES_A_CELL * count + 1)
    between = np.arange(1, count) / count
    steps, _ = profile(lengths[..., None] * (places[:, None] - between).astype(np.float32))
    jumps = np.diff(cells)[..., None].astype(np.float32)
    return np.asarray(((1 + steps) / 2 @ jumps)[..., 0], dtype=np.float32)


def inward_normals(corners: Floats) -> Floats:
    """Give the unit normals (n, 4, 2) of tags' sides, each from one of the corners (n, 4, 2) to the next."""
    sides = np.roll(corners, -1, axis=1) - corners
    inwards = np.stack([-sides[..., 1], sides[..., 0]], axis=-1)
    return np.asarray(inwards / np.linalg.norm(inwards, axis=-1, keepdims=True))


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
