"""Corners where four squares meet, measured on the grey values along the edges that cross in them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import pi

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.crossings import UNMODELLED_VARIANCE, Crossings, crossings_of, fit_crossings
from calib.detection.edge_profile import FIRST_BLUR
from calib.detection.grey_fit import GreyFit, Light
from calib.detection.misfit import uncovered
from calib.detection.picture import Picture
from calib.detection.plane import PlaneView, bent_view, span_a_plane
from calib.detection.strips import Floats, Patches, Singles, strips

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
MAY_MOVE = 4.0  # px from where a corner was thought to be; further off is another
MUCH_BLURRED = 3.0  # times what most are; what is more so is no crossing of edges
MISFIT = 0.3  # of the contrast; more and something else is in sight
COVERED = 0.07  # of the contrast; less is left where nothing covers an edge
AT_A_TIME = 40_000  # pixels: more are slower, fewer do not make up for the calls
UNMEASURED_VARIANCE = 0.5**2  # px²; where the drawing does not fit


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
    """Measure the corners at points (n, 2) of a print, in m, most of them within 2 px or so of pixels (n, 2).

    Edges run through them along x and y, with the next ones `pitch` (m) away and nothing else `clear` (m) to both
    sides. Where those that are found lie on one line they do not tell how the print lies, and are as they were given.
    """
    n, given = len(pixels), pixels
    crossings = crossings_of(bent_view(view, points, pixels, picture.middle), points, pixels, pitch, clear)
    near = replace(crossings, lengths=np.minimum(crossings.lengths, FIRST_LENGTH))
    width = max(min(FIRST_WIDTH, float(np.median(crossings.clear))), NARROWEST)
    rough = _fit(picture, near, width, np.full(n, FIRST_BLUR), Light.unknown(n))
    guesses = np.tile(UNMEASURED_VARIANCE * np.eye(2), (n, 1, 1))
    found = _shown(rough, picture.noise)
    if not span_a_plane(points[found]):
        return Corners(given, guesses, found)
    pixels = pixels + rough.parameters[:, :2]
    blurs = np.exp(np.where(found, rough.parameters[:, 2], np.median(rough.parameters[found, 2])))
    sharp = bool(np.median(blurs) < SHARPEST)
    if sharp:
        softened = cv2.GaussianBlur(picture.values.astype(np.float32), (0, 0), SOFTENING)
        picture = replace(picture, values=np.asarray(softened, dtype=np.float32))
        blurs = np.hypot(blurs, SOFTENING)

    bent = bent_view(view, points[found], pixels[found], picture.middle)
    # Where a search was too far off, the other corners know better.
    pixels = np.where(found[:, None], pixels, bent.project(points))
    crossings = crossings_of(bent, points, pixels, pitch, clear)
    levels = np.log(np.maximum(rough.means + np.abs(rough.steps), 1))
    light = Light.followed(pixels, levels, found, float(np.median(crossings.lengths)))
    blur = float(np.median(blurs))
    width = max(min(SHOWN * blur, float(np.median(crossings.clear)) - NEIGHBOURS_REACH * blur), NARROWEST)
    fit = _fit(picture, crossings, width, blurs, light)
    found = uncovered(fit.scatters, np.abs(fit.steps), picture.noise, _shown(fit, picture.noise), COVERED)
    scatter = fit.covariances[:, :2, :2] * (SHARED_NOISE if sharp else 1)
    return Corners(
        np.where(found[:, None], pixels + fit.parameters[:, :2], given),
        np.where(found[:, None, None], scatter + UNMODELLED_VARIANCE * np.eye(2), guesses),
        found,
    )


def _fit(picture: Picture, crossings: Crossings, width: float, blurs: Floats, light: Light) -> GreyFit:
    """Fit corners to the pixels along their edges, so many at a time as a processor's cache holds."""
    pixels = 8 * width * float(crossings.lengths.max()) * len(blurs)
    size = -(-len(blurs) // int(1 + pixels / AT_A_TIME))
    fits: list[GreyFit] = []
    for first in range(0, len(blurs), size):
        some = slice(first, first + size)
        part = crossings.part(some)
        patches, heights = _patches(picture, part, width)
        fits.append(fit_crossings(picture, part, patches, heights, blurs[some], light.part(some)))
    return GreyFit.joined(fits)


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
