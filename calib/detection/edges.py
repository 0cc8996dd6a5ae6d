"""How wide the edges in a picture are, in every direction: blur, and the smear of a motion."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, hypot, isqrt, pi, sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

REACH = 12.0  # px to either side of an edge: edges of more than twice this are told as about that wide
STEP = 0.5  # px between the samples of a profile
MOST_EDGES = 1000
FEWEST_EDGES = 30
DIRECTIONS = 12
FEWEST_IN_A_DIRECTION = 8, 0.05  # edges, and of all of them: corners have a few edges of any direction
LEAST_STEP = 0.5  # of the region's contrast: ink against paper, and not a shadow
CLEAR_OF_NOISE = 8.0  # times the noise: a step of less tells nothing of its width
BOX_FROM_WIDTH = sqrt(12) / 2.563  # a Gaussian's edge is 2.563 deviations wide, a box has length / sqrt(12)

ENOUGH = 100_000  # pixels, to tell a percentile by

Array = NDArray[np.float64]
Singles = NDArray[np.float32]


@dataclass(frozen=True)
class Edges:
    """The widths of the edges in a picture: from 10 to 90 % of the step, in px.

    `narrowest_px` and `widest_px` are those across the directions in which edges are sharpest and least sharp;
    the latter is at `direction` (rad, from the picture's x to its y, 0 to pi). A lens that is out of focus
    makes all edges wide, a motion those across it: `smear_px` is the length of the motion that explains the
    difference. Where there are edges of one direction only, or of two at right angles and the motion is
    diagonal to them, nothing tells motion from blur, and the two widths are the same.
    """

    count: int
    narrowest_px: float
    widest_px: float
    direction: float
    smear_px: float


def sample_of(
    values: NDArray[np.uint8 | np.uint16], region: NDArray[np.bool_] | None
) -> NDArray[np.uint8 | np.uint16]:
    """Take grey `values` (h, w), or those of a `region` (h, w), from here and there: enough to tell percentiles by."""
    count = values.size if region is None else np.count_nonzero(region)
    apart = 1 + isqrt(count // ENOUGH)
    some = values[::apart, ::apart]
    return some.ravel() if region is None else some[region[::apart, ::apart]]


def measure_edges(
    values: NDArray[np.uint8 | np.uint16],
    noise: float,
    region: NDArray[np.bool_] | None = None,
    reach: float = REACH,
) -> Edges | None:
    """Measure the edges of grey `values` (h, w), or of a `region` (h, w) of them; None where there are too few.

    `noise` is the standard deviation of the grey values, `reach` (px) how far the next edge is at least.
    """
    if region is not None:
        rows, columns = (np.flatnonzero(region.any(axis=axis)) for axis in (1, 0))
        # Edges at the region's rim are seen in full.
        beyond = int(np.ceil(reach)) + 1
        window = tuple(slice(max(at[0] - beyond, 0), at[-1] + beyond + 1) for at in (rows, columns))
        values, region = values[window], region[window]
    dark, bright = np.percentile(sample_of(values, region), (1, 99))
    step = LEAST_STEP * float(bright - dark)
    if step < CLEAR_OF_NOISE * noise:
        return None
    singles = values.astype(np.float32)
    smooth = cv2.GaussianBlur(singles, (0, 0), 1.0)
    along_x, along_y = (cv2.Scharr(smooth, cv2.CV_32F, *order, scale=1 / 32) for order in ((1, 0), (0, 1)))
    steep = np.asarray(cv2.magnitude(along_x, along_y))
    # Flat enough to catch the widest edge that can be told; which of them are edges the profiles say.
    candidates = steep > max(step / (2 * reach), noise)
    if region is not None:
        candidates &= region
    places = np.flatnonzero(candidates)
    chosen = places[np.linspace(0, len(places) - 1, min(len(places), MOST_EDGES)).astype(int)]
    y, x = np.divmod(chosen, values.shape[1])
    normals = np.column_stack([along_x[y, x], along_y[y, x]]).astype(np.float64) / steep[y, x, None]
    widths = _widths(singles, np.column_stack([x, y]), normals, reach, step)
    known = np.isfinite(widths)
    if known.sum() < FEWEST_EDGES:
        return None
    return _by_direction(widths[known], np.arctan2(normals[known, 1], normals[known, 0]))


def _widths(
    values: NDArray[np.float32], places: NDArray[np.int64], normals: Array, reach: float, step: float
) -> Array:
    """Measure the widths (m,) of edges at `places` (m, 2), from dark to bright along `normals` (m, 2).

    NaN where the step is smaller than `step`, or the place is not amid it.
    """
    half = round(reach / STEP)
    along = (STEP * np.arange(-half, half + 1)).astype(np.float32)
    # Three profiles side by side: half the noise, for no blur that counts.
    aside = np.array([[-1.0], [0.0], [1.0]], dtype=np.float32)
    x, y = places.astype(np.float32).T[:, :, None, None]
    normal_x, normal_y = normals.astype(np.float32).T[:, :, None, None]
    samples = _sampled(
        values, x + along * normal_x - aside * normal_y, y + along * normal_y + aside * normal_x
    )
    profiles = samples.mean(axis=1, dtype=np.float64)
    before, after = profiles[:, half::-1], profiles[:, half:]
    dark, bright = before.min(axis=1), after.max(axis=1)
    rise = np.maximum(bright - dark, 1e-9)
    middle = (profiles[:, half] - dark) / rise
    width = _first_beyond((after - dark[:, None]) / rise[:, None], 0.9)
    width += _first_beyond((bright[:, None] - before) / rise[:, None], 0.9)
    return np.where((rise >= step) & (abs(middle - 0.5) < 0.25), STEP * width, np.nan)


def _sampled(values: NDArray[np.float32], x: Singles, y: Singles) -> Singles:
    """Interpolate `values` (h, w) at `x` and `y` (...), the border's beyond it: as cv2.remap, of any size."""
    height, width = values.shape
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    column, row = np.minimum(x.astype(np.intp), width - 2), np.minimum(y.astype(np.intp), height - 2)
    right, down = x - column.astype(np.float32), y - row.astype(np.float32)
    first = row * width + column
    above = _between(values.take(first), values.take(first + 1), right)
    first += width
    return _between(above, _between(values.take(first), values.take(first + 1), right), down)


def _between(first: Singles, last: Singles, part: Singles) -> Singles:
    return first + part * (last - first)


def _first_beyond(profiles: Array, level: float) -> Array:
    """Return where (m,) each of `profiles` (m, n), which reach 1, first passes `level`, in samples."""
    first = np.argmax(profiles >= level, axis=1)
    row = np.arange(len(profiles))
    last, beyond = profiles[row, np.maximum(first - 1, 0)], profiles[row, first]
    back = (beyond - level) / np.maximum(beyond - last, 1e-9)
    return np.asarray(np.where(first > 0, first - back, 0.0))


def _by_direction(widths: Array, directions: Array) -> Edges:
    """Fit squared widths as a blur's covariance has them: a + b cos 2t + c sin 2t, from each direction's median."""
    turned = np.floor(directions / pi * DIRECTIONS + 0.5).astype(int) % DIRECTIONS
    fewest, share = FEWEST_IN_A_DIRECTION
    rows = []
    for one in range(DIRECTIONS):
        own = turned == one
        if own.sum() >= max(fewest, share * len(widths)):
            twice = 2 * directions[own]
            rows.append((np.cos(twice).mean(), np.sin(twice).mean(), np.median(widths[own]) ** 2))
    if not rows:
        width = float(np.median(widths))
        return Edges(len(widths), width, width, 0.0, 0.0)
    cosine, sine, square = np.array(rows).T
    # Directions that the edges do not tell are not made up: b and c are drawn to 0, a is not.
    design = np.column_stack([np.ones(len(rows)), cosine, sine])
    normal = design.T @ design + np.diag([0.0, 0.1, 0.1])
    a, b, c = np.linalg.solve(normal, design.T @ square)
    spread = hypot(b, c)
    # Edges of few directions leave the extremes between them open: no more is said than was seen.
    narrowest, widest = np.clip([a - spread, a + spread], square.min(), square.max())
    return Edges(
        count=len(widths),
        narrowest_px=sqrt(narrowest),
        widest_px=sqrt(widest),
        direction=(atan2(c, b) / 2) % pi,
        smear_px=BOX_FROM_WIDTH * sqrt(widest - narrowest),
    )
