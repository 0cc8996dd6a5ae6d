"""Corners where four squares meet, measured on the grey values along the edges that cross in them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import partial
from math import pi

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.edge_profile import FIRST_BLUR, LEAST_BLUR, profile
from calib.detection.grey_fit import GreyFit, Light, fit_grey_values
from calib.detection.picture import Picture
from calib.detection.plane import BentView, PlaneView, bent_view
from calib.detection.smooth import smooth
from calib.detection.strips import Floats, Patches, Singles, strips

REACHED = 0.5  # of the way to the next corner, so that no pixel tells of two
FIRST_LENGTH, FIRST_WIDTH = 10.0, 5.0  # px; of the edges and to both sides, while corners are known roughly
SHOWN = (
    3.0  # standard deviations of the blur to both sides of an edge: what tells where it is, and its levels
)
NARROWEST = 1.5  # px; of what is taken to each side
NEIGHBOURS_REACH = 2.0
"""In standard deviations of the blur: neighbours look the same turned half way, and pull to neither side."""
SHARPEST = 0.45  # px; in sharper pictures places depend on where the pixels lie
SOFTENING = 1.0  # px, standard deviation
SHARED_NOISE = 4 * pi * SOFTENING**2  # pixels of a softened picture that have one noise
LIGHTS_DEGREE = 3
LEAST_SLOPE = 1e-6  # of the light a px
MAY_MOVE = 4.0  # px from where a corner was thought to be; further off is another
MUCH_BLURRED = 3.0  # times what most are; what is more so is no crossing of edges
MISFIT = 0.3  # of the contrast; more and something else is in sight
UNMODELLED_VARIANCE = 0.001**2  # px²; the shape of the pixels and of the lens' blur
UNMEASURED_VARIANCE = 0.5**2  # px²; where the drawing does not fit


@dataclass(frozen=True, eq=False)
class Crossings:
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

    def heights(self, x: Singles, y: Singles) -> tuple[Singles, Singles]:
        """Tell how far (n, m) to the right of the one edge and of the other places (n, m) are, px from the corners."""
        directions, bends = (each.astype(np.float32)[..., None] for each in (self.directions, self.bends))
        heights: list[Singles] = []
        for edge in range(2):
            unit_x, unit_y = directions[:, edge, 0], directions[:, edge, 1]
            along_it = unit_x * x + unit_y * y
            heights.append(np.asarray(unit_x * y - unit_y * x - bends[:, edge] / 2 * along_it * along_it))
        return heights[0], heights[1]


@dataclass(frozen=True, eq=False)
class Corners:
    """Measured `pixels` (n, 2), their `covariances` (n, 2, 2) in px², and which of them are `found` (n,).

    Those that are not are as they were given, with a covariance as if that were a guess.
    """

    pixels: Floats
    covariances: Floats
    found: NDArray[np.bool_]


def measure_corners(
    picture: Picture, view: PlaneView, points: Floats, pixels: Floats, pitch: float, clear: float
) -> Corners:
    """Measure the corners at points (n, 2) of a print, in m, which are within 2 px or so of pixels (n, 2).

    Edges run through them along x and y, with the next ones `pitch` (m) away and nothing else `clear` (m) to both
    sides.
    """
    n, given = len(pixels), pixels
    crossings = crossings_of(bent_view(view, points, pixels, picture.middle), points, pixels, pitch, clear)
    near = replace(crossings, lengths=np.minimum(crossings.lengths, FIRST_LENGTH))
    width = max(min(FIRST_WIDTH, float(np.median(crossings.clear))), NARROWEST)
    rough = _fit(picture, near, width, np.full(n, FIRST_BLUR), Light.unknown(n))
    guesses = np.tile(UNMEASURED_VARIANCE * np.eye(2), (n, 1, 1))
    found = _shown(rough, picture.noise)
    if not found.any():
        return Corners(given, guesses, found)
    pixels = np.where(found[:, None], pixels + rough.parameters[:, :2], pixels)
    blurs = np.exp(np.where(found, rough.parameters[:, 2], np.median(rough.parameters[found, 2])))
    sharp = bool(np.median(blurs) < SHARPEST)
    if sharp:
        softened = cv2.GaussianBlur(picture.values.astype(np.float32), (0, 0), SOFTENING)
        picture = replace(picture, values=np.asarray(softened, dtype=np.float32))
        blurs = np.hypot(blurs, SOFTENING)

    bent = bent_view(view, points[found], pixels[found], picture.middle)
    crossings = crossings_of(bent, points, pixels, pitch, clear)
    levels = np.log(np.maximum(rough.means + np.abs(rough.steps), 1))
    light = light_at(pixels, levels, found, float(np.median(crossings.lengths)))
    blur = float(np.median(blurs))
    width = max(min(SHOWN * blur, float(np.median(crossings.clear)) - NEIGHBOURS_REACH * blur), NARROWEST)
    fit = _fit(picture, crossings, width, blurs, light)
    found &= _shown(fit, picture.noise)
    scatter = fit.covariances[:, :2, :2] * (SHARED_NOISE if sharp else 1)
    return Corners(
        np.where(found[:, None], pixels + fit.parameters[:, :2], given),
        np.where(found[:, None, None], scatter + UNMODELLED_VARIANCE * np.eye(2), guesses),
        found,
    )


def crossings_of(view: BentView, points: Floats, pixels: Floats, pitch: float, clear: float) -> Crossings:
    """Say what the corners look like that a view shows at points (n, 2), and that are roughly at pixels (n, 2)."""
    steps = pitch / 2 * np.array([[0, 0], [1, 0], [0, 1], [-1, 0], [0, -1]])
    middle, ahead, behind = np.split(view.project(points[:, None] + steps), [1, 3], axis=1)
    chords = ahead - behind
    spacings = np.linalg.norm(chords, axis=-1)
    directions = chords / spacings[..., None]
    bends = _cross(directions, ahead + behind - 2 * middle) / (spacings / 2) ** 2
    # Edges that are not at right angles are nearer to the next ones than the spacing says.
    apart = spacings.min(axis=1) * np.abs(_cross(directions[:, 0], directions[:, 1]))
    return Crossings(pixels, directions, bends, REACHED * spacings, apart * clear / pitch)


def light_at(pixels: Floats, levels: Floats, good: NDArray[np.bool_], apart: float) -> Light:
    """Follow the light's logarithms (n,) from good corner to good corner, which are so far `apart` (px)."""
    light = smooth(pixels[good], levels[good, None], LIGHTS_DEGREE)
    slopes = [(light.at(pixels + step) - light.at(pixels - step)) / 2 for step in np.eye(2)]
    off = float(np.sqrt(np.square(levels[good, None] - light.at(pixels[good])).mean()))
    return Light(np.concatenate(slopes, axis=1), max(off / apart, LEAST_SLOPE))


def _fit(picture: Picture, crossings: Crossings, width: float, blurs: Floats, light: Light) -> GreyFit:
    start = np.column_stack([np.zeros((len(blurs), 2)), np.log(blurs)])
    least = np.array([-np.inf, -np.inf, np.log(LEAST_BLUR)])
    patches, heights = _patches(picture, crossings, width)
    shape = partial(saddle, crossings.directions.astype(np.float32), heights)
    return fit_grey_values(picture, patches, shape, start, least, light)


def _shown(fit: GreyFit, noise: float) -> NDArray[np.bool_]:
    """Tell which fits (n,) came to an end at a corner, and not at what covers it."""
    contrasts, (off_x, off_y, blurs) = np.abs(fit.steps), fit.parameters.T
    shown = fit.converged & (contrasts > noise) & (fit.scatters < np.hypot(2 * noise, MISFIT * contrasts))
    shown &= np.hypot(off_x, off_y) < MAY_MOVE
    if shown.any():
        shown &= blurs < np.median(blurs[shown]) + np.log(MUCH_BLURRED)
    return shown


def _patches(picture: Picture, crossings: Crossings, width: float) -> tuple[Patches, tuple[Singles, Singles]]:
    """Take the pixels along both edges of each crossing; and how far (n, m) they are to the right of either."""
    n = len(crossings.pixels)
    reach = (crossings.lengths[..., None] * crossings.directions).reshape(-1, 2)
    along = strips(picture, np.repeat(crossings.pixels, 2, axis=0), -reach, reach, width)
    x, y, values, used = (getattr(along, field.name).reshape(n, -1) for field in fields(Patches))
    one, other = crossings.heights(x, y)
    # Where the strips overlap, a pixel belongs to the edge that it is nearer to.
    nearer = np.abs(one) <= np.abs(other)
    m = x.shape[1] // 2
    used[:, :m] *= nearer[:, :m]
    used[:, m:] *= ~nearer[:, m:]
    return Patches(x, y, values, used), (one, other)


def saddle(
    directions: Singles, heights: tuple[Singles, Singles], parameters: Floats
) -> tuple[Singles, Singles]:
    """Draw corners of parameters (n, 3): how far off in x and y, and the blur's logarithm."""
    off_x, off_y, blur = parameters.astype(np.float32).T[..., None]
    scale: Singles = np.exp(-blur)
    (one_x, one_y), (other_x, other_y) = np.moveaxis(directions, 0, -1)[..., None]
    one_height: Singles = scale * (heights[0] - one_x * off_y + one_y * off_x)
    other_height: Singles = scale * (heights[1] - other_x * off_y + other_y * off_x)
    (one, one_slope), (other, other_slope) = profile(one_height), profile(other_height)
    by_one = 2 * scale * one_slope * other
    by_other = 2 * scale * other_slope * one
    derivatives = np.empty((len(parameters), 3, one.shape[1]), dtype=np.float32)
    derivatives[:, 0] = one_y * by_one + other_y * by_other
    derivatives[:, 1] = -one_x * by_one - other_x * by_other
    derivatives[:, 2] = -(one_height * by_one + other_height * by_other) / scale
    # Where the edges are not at right angles, blur rounds the corner off: the first term of the tetrachoric series.
    slanted = one_x * other_x + one_y * other_y
    return one * other + 4 * slanted * one_slope * other_slope, derivatives


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
