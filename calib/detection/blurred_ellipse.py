"""Blurred ellipses fitted to grey values: of all fits, the likeliest under the picture's noise.

Under a homography a disk's picture is an ellipse and its centroid the ellipse's centre. (A lens bends it too,
over one disk by so little that the centroid stays where it is to 0.001 px.) Whatever the model leaves out that
is the same on opposite sides of a disk, such as what the blur does to a bent edge, cannot move the centre.

All fits are done side by side, so arrays are padded: n ellipses, of the longest number m of pixels or blocks.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Values = NDArray[np.float32]

CENTRE, SHAPE, BLUR, LIGHT = slice(0, 2), slice(2, 5), 5, slice(6, 10)
PARAMETERS = 10
MOST_STEPS = 6
STANDS_STILL = 0.03  # px
LEAST_BLUR = 0.3  # px; a pixel's own square has sqrt(1 / 12)
LONGEST_STEP = 1.0  # px
SQRT_2_PI = float(np.sqrt(2 * np.pi))
TINY = 1e-12
RIDGE = 1e-9  # of the normalised equations, for what a picture does not tell


class Samples(NamedTuple):
    """Grey values (n, m) and where they are, x and y (n, m) in px from each ellipse's own origin.

    A value is the mean over `weights` pixels; 0 is padding.
    """

    x: Values
    y: Values
    values: Values
    weights: Values


@dataclass(frozen=True, eq=False)
class Ellipses:
    """n ellipses: points v from the centre where v' M v = 1, under a light that changes from side to side.

    Light multiplies what paper and ink reflect: the grey values of the brighter of the two change by `slope`
    (n, 2) a pixel, and those of the darker in proportion.
    """

    centres: Array  # (n, 2) px, from each one's own origin
    shapes: Array  # (n, 3): M's entries xx, xy and yy, 1/px²
    blurs: Array  # (n,) standard deviation of the edge's spread, px, that of the pixels included
    paper: Array  # (n,) grey values at the origin
    ink: Array  # (n,)
    slopes: Array  # (n, 2)

    def distances(self, x: Values, y: Values) -> Values:
        """Return how far inside the edge places (n, m) are (px): exact at the edge, and about right beyond."""
        return _seen(self, x, y).depth

    def reflectances(self) -> tuple[Array, Array]:
        """Return what paper and ink (n,) reflect, relative to the brighter of them."""
        brighter = np.maximum(np.maximum(self.paper, self.ink), TINY)
        return self.paper / brighter, self.ink / brighter

    def part(self, chosen: NDArray[np.int64]) -> Ellipses:
        """Return the chosen ones."""
        return Ellipses(*(getattr(self, field.name)[chosen] for field in fields(self)))


class Fitted(NamedTuple):
    """Ellipses, the covariances (n, 2, 2) of their centres (px²), and the variances (n,) left of the grey values.

    The covariances are of the scatter that each fit leaves.
    """

    ellipses: Ellipses
    covariances: Array
    variances: Array


def fit(start: Ellipses, edges: Samples, plain: Samples, still: float = STANDS_STILL) -> Fitted:
    """Fit ellipses to pixels near their `edges`, and their light to the `plain` paper and ink as well.

    A step of less than `still` (px) is the last; the next one would be a twentieth of it.
    """
    ellipses = start
    inside = (start.distances(plain.x, plain.y) > 0).astype(np.float32)
    for _ in range(MOST_STEPS):
        equations = _equations(ellipses, edges, plain, inside)
        steps = equations.solved()
        ellipses = _moved(ellipses, steps)
        if np.abs(steps[:, CENTRE]).max() < still:
            break
    counts = np.count_nonzero(edges.weights, axis=1) + np.count_nonzero(plain.weights, axis=1)
    left = equations.squares - np.sum(equations.sides * steps, axis=1)
    variances = np.maximum(left, 0) / np.maximum(counts - PARAMETERS, 1)
    return Fitted(ellipses, equations.inverses_of_centres() * variances[:, None, None], variances)


@dataclass(frozen=True, eq=False)
class _Equations:
    """Normal equations: `matrices` (n, 10, 10), right `sides` (n, 10), and `squares` (n,) of what was left before."""

    matrices: Array
    sides: Array
    squares: Array

    def solved(self) -> Array:
        """Return the solutions (n, 10)."""
        units, scaled = self._scaled()
        solutions = np.linalg.solve(scaled, (units * self.sides)[..., None])[..., 0]
        return np.asarray(units * solutions)

    def inverses_of_centres(self) -> Array:
        """Return the part (n, 2, 2) of the inverse matrices that belongs to the centres."""
        units, scaled = self._scaled()
        of_centres = np.broadcast_to(np.eye(PARAMETERS)[:, CENTRE], (len(units), PARAMETERS, 2))
        inverses = np.linalg.solve(scaled, of_centres)[:, CENTRE]
        return np.asarray(inverses * units[:, CENTRE, None] * units[:, None, CENTRE])

    def _scaled(self) -> tuple[Array, Array]:
        """Return the parameters' units (n, 10) in which the entries are of one size, and the matrices in them."""
        units = 1 / np.sqrt(np.maximum(np.einsum("nii->ni", self.matrices), TINY))
        scaled = self.matrices * (units[:, :, None] * units[:, None])
        return units, scaled + RIDGE * np.eye(PARAMETERS)


class _Seen(NamedTuple):
    """What places (n, m) are to ellipses."""

    from_centre: tuple[Values, Values]
    normal: tuple[Values, Values]  # M v, outwards
    radius: Values  # sqrt(v' M v)
    steepness: Values  # |M v|
    depth: Values  # px inside the edge


def _seen(ellipses: Ellipses, x: Values, y: Values) -> _Seen:
    vx, vy = x - _rows(ellipses.centres[:, 0]), y - _rows(ellipses.centres[:, 1])
    xx, xy, yy = (_rows(entry) for entry in ellipses.shapes.T)
    nx, ny = xx * vx + xy * vy, xy * vx + yy * vy
    radius = np.sqrt(np.maximum(vx * nx + vy * ny, TINY))
    steepness = np.sqrt(np.maximum(nx * nx + ny * ny, TINY))
    return _Seen((vx, vy), (nx, ny), radius, steepness, (1 - radius) * radius / steepness)


def _equations(ellipses: Ellipses, edges: Samples, plain: Samples, inside: Values) -> _Equations:
    near = _near_edges(ellipses, edges)
    light = np.empty((len(inside), LIGHT.stop - LIGHT.start + 1, inside.shape[1]), np.float32)
    light[:, -1] = plain.values - _under_light(ellipses, plain.x, plain.y, inside, light[:, :-1])
    # A block's mean has less noise than a pixel.
    light *= np.sqrt(plain.weights)[:, None]
    # All but the last row times all of them: numpy takes several times as long for a product with itself.
    products = (near[:, :-1] @ near.swapaxes(1, 2)).astype(np.float64)
    products[:, LIGHT, [*range(LIGHT.start, LIGHT.stop), -1]] += light[:, :-1] @ light.swapaxes(1, 2)
    squares = np.square(near[:, -1]).sum(axis=1) + np.square(light[:, -1]).sum(axis=1)
    return _Equations(products[..., :-1], products[..., -1], squares.astype(np.float64))


def _near_edges(ellipses: Ellipses, edges: Samples) -> Values:
    """Return the derivatives of grey values near edges by all parameters, and in the last row what is left.

    All are (n, 11, m).
    """
    from scipy.special import ndtr  # heavy to import, and a daemon that serves poses measures no disks

    (vx, vy), (nx, ny), radius, steepness, depth = _seen(ellipses, edges.x, edges.y)
    rows = np.empty((len(vx), PARAMETERS + 1, vx.shape[1]), np.float32)
    jacobian = rows[:, :-1]
    blur = _rows(ellipses.blurs)
    inwards = depth / blur
    rows[:, -1] = edges.values - _under_light(ellipses, edges.x, edges.y, ndtr(inwards), jacobian[:, LIGHT])
    of_paper, of_ink = ellipses.reflectances()
    by_light = of_ink - of_paper
    contrast = _rows(ellipses.ink - ellipses.paper)
    contrast = contrast + _rows(ellipses.slopes[:, 0] * by_light) * edges.x
    contrast += _rows(ellipses.slopes[:, 1] * by_light) * edges.y
    rise = contrast * np.exp(-0.5 * inwards * inwards) / (SQRT_2_PI * blur)
    by_normal = rise / steepness
    by_shape = by_normal / (-2 * radius)
    np.multiply(by_normal, nx, out=jacobian[:, 0])
    np.multiply(by_normal, ny, out=jacobian[:, 1])
    np.multiply(by_shape * vx, vx, out=jacobian[:, 2])
    np.multiply(2 * by_shape * vx, vy, out=jacobian[:, 3])
    np.multiply(by_shape * vy, vy, out=jacobian[:, 4])
    np.multiply(rise, -inwards, out=jacobian[:, BLUR])
    rows *= edges.weights[:, None]
    return rows


def _under_light(ellipses: Ellipses, x: Values, y: Values, inside: Values, derivatives: Values) -> Values:
    """Return grey values (n, m) where the ellipse covers a part `inside` of each.

    Their derivatives (n, 4, m) by paper, ink and both slopes are written into `derivatives`.
    """
    of_paper, of_ink = ellipses.reflectances()
    reflected = _rows(of_paper) + _rows(of_ink - of_paper) * inside
    np.subtract(1, inside, out=derivatives[:, 0])
    derivatives[:, 1] = inside
    np.multiply(x, reflected, out=derivatives[:, 2])
    np.multiply(y, reflected, out=derivatives[:, 3])
    light = np.column_stack([ellipses.paper, ellipses.ink, ellipses.slopes]).astype(np.float32)
    return np.asarray((light[:, None] @ derivatives)[:, 0])


def _moved(ellipses: Ellipses, steps: Array) -> Ellipses:
    furthest = np.abs(steps[:, CENTRE]).max(axis=1)
    steps = steps * np.minimum(1, LONGEST_STEP / np.maximum(furthest, LONGEST_STEP))[:, None]
    return replace(
        ellipses,
        centres=ellipses.centres + steps[:, CENTRE],
        shapes=ellipses.shapes + steps[:, SHAPE],
        blurs=np.clip(ellipses.blurs + steps[:, BLUR], LEAST_BLUR, 2 * ellipses.blurs),
        paper=ellipses.paper + steps[:, 6],
        ink=ellipses.ink + steps[:, 7],
        slopes=ellipses.slopes + steps[:, 8:],
    )


def _rows(numbers: Array) -> Values:
    """Stand n numbers up for arrays (n, m) of single precision, which is 1e-5 px on a disk."""
    return numbers.astype(np.float32)[:, None]
