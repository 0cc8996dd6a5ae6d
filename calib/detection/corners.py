"""Corners where four squares meet, measured on the grey values along the edges that cross in them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np

from calib.detection.edge_profile import FIRST_BLUR, clear_width, correlated, profile
from calib.detection.grey_fit import Floats, Patches, Singles, fit_grey_values, patches_of
from calib.detection.picture import Picture
from calib.detection.plane import BentView, PlaneView, bent_view
from calib.detection.strips import strips

SMALLEST_WINDOW, LARGEST_WINDOW = 2, 7  # px; of the operator that brings corners near to their places
SMOOTHING = (
    1.0  # px; differences between neighbouring pixels magnify noise and depend on where the pixels lie
)
STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 20, 1e-2)
FIRST_LENGTH = 8.0  # px; of the edges, while the corners are known roughly
SHORTEST, LONGEST = 2.0, 48.0  # px; of the edges: beyond, a bend is more than a parabola
REACHED = (
    0.35  # of the distance to the next corner; prints and lenses keep edges straight near the corner only
)
NEIGHBOURS_REACH = (
    2.0  # standard deviations of the blur; they look the same turned half way, and pull to neither side
)
MOST_TURNED = 0.3  # radians; more is another thing
UNMODELLED_VARIANCE = 0.002**2  # px²; the shape of the pixels and of the lens' blur
UNMEASURED_VARIANCE = 0.5**2  # px²; where the drawing does not fit


@dataclass(frozen=True, eq=False)
class _Crossings:
    """Roughly what n corners look like: two edges cross at each of the `pixels` (n, 2).

    `directions` (n, 2, 2) are the unit vectors along the one and the other; `bends` (n, 2) their curvatures in
    1/px, positive where they curve to the right of them (in a picture whose y points down).
    Nothing but the two edges is to be seen up to `lengths` (n, 2) px along each, in a strip of `clear` (n,) px to
    both sides of each.
    """

    pixels: Floats
    directions: Floats
    bends: Floats
    lengths: Floats
    clear: Floats


def measure_corners(
    picture: Picture, view: PlaneView, points: Floats, pixels: Floats, pitch: float, clear: float
) -> tuple[Floats, Floats]:
    """Measure the corners at points (n, 2) of a print, in m, which are roughly at pixels (n, 2).

    Edges run through them along x and y, with the next ones `pitch` (m) away and nothing else `clear` (m) to both
    sides. Gives the pixels (n, 2), and their covariances (n, 2, 2) in px².
    """
    blur = FIRST_BLUR
    crossings = _crossings(bent_view(view, points, pixels), points, pixels, pitch, clear)
    near = pixels = _brought_near(picture, crossings)
    for longest in (FIRST_LENGTH, LONGEST):
        crossings = _crossings(bent_view(view, points, pixels), points, pixels, pitch, clear)
        patches = _patches(
            picture,
            crossings,
            longest,
            clear_width(blur, float(np.median(crossings.clear)), NEIGHBOURS_REACH),
        )
        start = np.zeros((len(pixels), 5))
        start[:, 4] = np.log(blur)
        fit = fit_grey_values(picture, patches, partial(_saddle, patches, crossings), start)
        moved = np.linalg.norm(pixels + fit.parameters[:, :2] - near, axis=1)
        turned = np.abs(fit.parameters[:, 2:4]).max(axis=1)
        good = fit.converged & (moved < crossings.lengths.min(axis=1)) & (turned < MOST_TURNED)
        pixels = np.where(good[:, None], pixels + fit.parameters[:, :2], near)
        blur = float(np.exp(np.median(fit.parameters[good, 4]))) if good.any() else blur
    measured = fit.covariances[:, :2, :2] + UNMODELLED_VARIANCE * np.eye(2)
    return pixels, np.where(good[:, None, None], measured, UNMEASURED_VARIANCE * np.eye(2))


def _crossings(view: BentView, points: Floats, pixels: Floats, pitch: float, clear: float) -> _Crossings:
    steps = pitch / 2 * np.eye(2)
    middle = view.project(points)[:, None]
    ahead, behind = (view.project(points[:, None] + sign * steps) for sign in (1, -1))
    chords = ahead - behind
    spacings = np.linalg.norm(chords, axis=-1)
    directions = chords / spacings[..., None]
    bends = _cross(directions, ahead + behind - 2 * middle) / (spacings / 2) ** 2
    # Edges that are not at right angles are nearer to the next ones than the spacing says.
    apart = spacings.min(axis=1) * np.abs(_cross(directions[:, 0], directions[:, 1]))
    lengths = np.clip(REACHED * spacings, SHORTEST, LONGEST)
    return _Crossings(pixels, directions, bends, lengths, apart * clear / pitch)


def _brought_near(picture: Picture, crossings: _Crossings) -> Floats:
    """Move corners to where the grey values' gradients point past them (Förstner's operator)."""
    smooth = cv2.GaussianBlur(picture.values, (0, 0), SMOOTHING)
    refined = crossings.pixels.astype(np.float32).reshape(-1, 1, 2)
    reach = np.minimum(crossings.lengths.min(axis=1), crossings.clear)
    halves = np.clip(np.floor(reach / np.sqrt(2)), SMALLEST_WINDOW, LARGEST_WINDOW).astype(int)
    for half in np.unique(halves):
        alike = np.ascontiguousarray(refined[halves == half])
        refined[halves == half] = cv2.cornerSubPix(smooth, alike, (int(half), int(half)), (-1, -1), STOP)
    return refined.reshape(-1, 2).astype(np.float64)


def _patches(picture: Picture, crossings: _Crossings, longest: float, width: float) -> Patches:
    pixels, n = crossings.pixels, len(crossings.pixels)
    reach = np.minimum(crossings.lengths, longest)[..., None] * crossings.directions
    starts, ends = ((pixels[:, None] + sign * reach).reshape(-1, 2) for sign in (-1, 1))
    around, wanted = strips(picture, starts, ends, width)
    around, wanted = around.reshape(n, 2, -1, 2), wanted.reshape(n, 2, -1)
    # Where the strips overlap, a pixel belongs to the edge that it is nearer to.
    offsets = around - pixels[:, None, None]
    distances = np.abs(_cross(crossings.directions[:, :, None, None], offsets[:, None]))
    one_is_nearer = distances[:, 0] <= distances[:, 1]
    wanted[:, 0] &= one_is_nearer[:, 0]
    wanted[:, 1] &= ~one_is_nearer[:, 1]
    return patches_of(picture, pixels, around.reshape(n, -1, 2), wanted.reshape(n, -1))


def _saddle(patches: Patches, crossings: _Crossings, parameters: Floats) -> tuple[Singles, Singles]:
    """Draw corners of parameters (n, 5): how far off in x and y, the edges' turns, the blur's logarithm."""
    columns = parameters.astype(np.float32)[..., None]
    off_x, off_y = patches.x - columns[:, 0], patches.y - columns[:, 1]
    scale = np.exp(-columns[:, 4])
    directions, bends = crossings.directions.astype(np.float32), crossings.bends.astype(np.float32)
    derivatives = np.empty((len(columns), 5, patches.x.shape[1]), dtype=np.float32)
    cosines, sines = np.cos(columns[:, 2:4]), np.sin(columns[:, 2:4])
    unit_x = cosines * directions[..., :1] - sines * directions[..., 1:]
    unit_y = sines * directions[..., :1] + cosines * directions[..., 1:]
    along = [unit_x[:, edge] * off_x + unit_y[:, edge] * off_y for edge in range(2)]
    heights = [
        scale
        * (unit_x[:, edge] * off_y - unit_y[:, edge] * off_x - bends[:, edge, None] / 2 * along[edge] ** 2)
        for edge in range(2)
    ]
    (one, one_slope), (other, other_slope) = (profile(height) for height in heights)
    correlation = np.asarray(unit_x[:, 0] * unit_x[:, 1] + unit_y[:, 0] * unit_y[:, 1], dtype=np.float32)
    rounding, by_heights = correlated(heights, (one_slope, other_slope), correlation)
    steep = (
        scale * (2 * one_slope * other + 4 * by_heights[0]),
        scale * (2 * other_slope * one + 4 * by_heights[1]),
    )
    derivatives[:, 0] = unit_y[:, 0] * steep[0] + unit_y[:, 1] * steep[1]
    derivatives[:, 1] = -unit_x[:, 0] * steep[0] - unit_x[:, 1] * steep[1]
    derivatives[:, 2] = -along[0] * steep[0]
    derivatives[:, 3] = -along[1] * steep[1]
    derivatives[:, 4] = -(heights[0] * steep[0] + heights[1] * steep[1]) / scale
    return one * other + 4 * rounding, derivatives


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
