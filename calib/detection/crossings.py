"""What corners look like where four squares meet: two edges that cross, in a drawing that is fitted to grey values."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np

from calib.detection.edge_profile import LEAST_BLUR, profile
from calib.detection.grey_fit import STANDS_STILL, GreyFit, Light, fit_grey_values
from calib.detection.picture import Picture
from calib.detection.plane import BentView
from calib.detection.strips import Floats, Patches, Singles

REACHED = 0.5  # of the way to the next corner, so that no pixel tells of two
UNMODELLED_VARIANCE = 0.001**2  # px²; the shape of the pixels and of the lens' blur


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

    def part(self, chosen: slice) -> Crossings:
        """Return the chosen ones."""
        return Crossings(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def heights(self, x: Singles, y: Singles) -> tuple[Singles, Singles]:
        """Tell how far (n, m) to the right of the one edge and of the other places (n, m) are, px from the corners."""
        directions, bends = (each.astype(np.float32)[..., None] for each in (self.directions, self.bends))
        heights: list[Singles] = []
        for edge in range(2):
            unit_x, unit_y = directions[:, edge, 0], directions[:, edge, 1]
            bent = unit_x * x
            bent += unit_y * y
            bent *= bent
            bent *= bends[:, edge] / 2
            height = unit_x * y
            height -= unit_y * x
            height -= bent
            heights.append(height)
        return heights[0], heights[1]


def crossings_of(view: BentView, points: Floats, pixels: Floats, pitch: float, clear: float) -> Crossings:
    """Say what the corners look like that a view shows at points (n, 2), and that are roughly at pixels (n, 2).

    Edges run through them along x and y, with the next ones `pitch` (m) away and nothing else `clear` (m) to both
    sides.
    """
    steps = pitch / 2 * np.array([[0, 0], [1, 0], [0, 1], [-1, 0], [0, -1]])
    middle, ahead, behind = np.split(view.project(points[:, None] + steps), [1, 3], axis=1)
    chords = ahead - behind
    spacings = np.linalg.norm(chords, axis=-1)
    directions = chords / spacings[..., None]
    bends = _cross(directions, ahead + behind - 2 * middle) / (spacings / 2) ** 2
    # Edges that are not at right angles are nearer to the next ones than the spacing says.
    apart = spacings.min(axis=1) * np.abs(_cross(directions[:, 0], directions[:, 1]))
    return Crossings(pixels, directions, bends, REACHED * spacings, apart * clear / pitch)


def fit_crossings(
    picture: Picture,
    crossings: Crossings,
    patches: Patches,
    heights: tuple[Singles, Singles],
    blurs: Floats,
    light: Light,
    still: float = STANDS_STILL,
) -> GreyFit:
    """Fit corners to patches of pixels that are at `heights` above their edges, from `blurs` (n,) px.

    The parameters (n, 3) are how far off the corners are in x and y, px, and the blurs' logarithms.
    """
    start = np.column_stack([np.zeros((len(blurs), 2)), np.log(blurs)])
    least = np.array([-np.inf, -np.inf, np.log(LEAST_BLUR)])
    slanted = (crossings.directions[:, 0] * crossings.directions[:, 1]).sum(axis=1).astype(np.float32)
    fit = fit_grey_values(picture, patches, partial(_saddle, slanted, heights), start, least, light, still)
    # How far to the right edges are is what corners are off by along the normals.
    from_right = np.zeros((len(blurs), 3, 3))
    normals = crossings.directions[..., ::-1] * [-1, 1]
    from_right[:, :2, :2], from_right[:, 2, 2] = np.linalg.inv(normals), 1
    return replace(
        fit,
        parameters=(from_right @ fit.parameters[..., None])[..., 0],
        covariances=from_right @ fit.covariances @ from_right.swapaxes(1, 2),
    )


def _saddle(
    slanted: Singles, heights: tuple[Singles, Singles], parameters: Floats
) -> tuple[Singles, Singles]:
    """Draw corners of parameters (n, 3): how far to the right both edges are, px, and the blur's logarithm."""
    right_one, right_other, blur = parameters.astype(np.float32).T[..., None]
    scale: Singles = np.exp(-blur)
    above_one, above_other = heights[0] - right_one, heights[1] - right_other
    (one, one_slope), (other, other_slope) = profile(scale * above_one), profile(scale * above_other)
    # Where the edges are not at right angles, blur rounds the corner off: the first term of the tetrachoric series.
    drawn = one_slope * other_slope
    drawn *= 4 * slanted[:, None]
    drawn += one * other
    derivatives = np.empty((len(parameters), 3, one.shape[1]), dtype=np.float32)
    by_one, by_other, by_blur = derivatives.swapaxes(0, 1)
    other *= -2 * scale
    one *= -2 * scale
    np.multiply(one_slope, other, out=by_one)
    np.multiply(other_slope, one, out=by_other)
    np.multiply(above_one, by_one, out=by_blur)
    above_other *= by_other
    by_blur += above_other
    return drawn, derivatives


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
