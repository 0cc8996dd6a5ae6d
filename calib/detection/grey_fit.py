"""Fits of a drawing's grey values to the pixels round many points at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from calib.detection.picture import Picture
from calib.detection.smooth import smooth
from calib.detection.strips import Floats, Patches, Singles

Shape = Callable[[Floats], tuple[Singles, Singles]]

MOST_STEPS = 12
STANDS_STILL = 0.05  # of a shape, in px, radians, or relative; each step leaves a tenth of the one before
LONGEST_STEP = 0.5  # the same, but at once
ROUNDING_VARIANCE = 1 / 12
LIGHTS_DEGREE = 3
LEAST_SLOPE = 1e-6  # of the light a px


@dataclass(frozen=True, eq=False)
class Light:
    """How the light on n pieces is expected to change over a pixel: by `slopes` (n, 2), give or take `std`.

    Both are relative to the light. What few pixels across an edge tell of it they tell of the edge's place, too.
    """

    slopes: Floats
    std: float

    @classmethod
    def unknown(cls, pieces: int) -> Light:
        """Of any slope that is seen on targets."""
        return cls(np.zeros((pieces, 2)), 0.005)

    @classmethod
    def followed(cls, pixels: Floats, levels: Floats, good: NDArray[np.bool_], apart: float) -> Light:
        """Follow it by the logarithms (n,) of levels from good piece to good piece, which are so far `apart` (px)."""
        light = smooth(pixels[good], levels[good, None], LIGHTS_DEGREE)
        slopes = [(light.at(pixels + step) - light.at(pixels - step)) / 2 for step in np.eye(2)]
        off = float(np.sqrt(np.square(levels[good, None] - light.at(pixels[good])).mean()))
        return cls(np.concatenate(slopes, axis=1), max(off / apart, LEAST_SLOPE))

    def part(self, chosen: slice) -> Light:
        """Return it on the chosen pieces."""
        return Light(self.slopes[chosen], self.std)


@dataclass(frozen=True, eq=False)
class GreyFit:
    """Each piece's shape: `parameters` (n, k), their `covariances` (n, k, k), and which have `converged` (n,).

    `means` (n,) are the grey values between those where the shape is 1 and those where it is -1, and `steps` (n,)
    halves of the difference; `scatters` (n,) are the standard deviations of the grey values about the drawing.
    """

    parameters: Floats
    covariances: Floats
    means: Floats
    steps: Floats
    scatters: Floats
    converged: NDArray[np.bool_]

    @classmethod
    def joined(cls, fits: Sequence[GreyFit]) -> GreyFit:
        """Put the fits of some pieces after those of others."""
        return cls(*(np.concatenate([getattr(fit, field.name) for fit in fits]) for field in fields(cls)))


@np.errstate(over="ignore", invalid="ignore")  # of a piece that leads nowhere, which has not converged
def fit_grey_values(
    picture: Picture,
    patches: Patches,
    shape: Shape,
    start: Floats,
    least: Floats,
    light: Light,
    still: float = STANDS_STILL,
) -> GreyFit:
    """Fit light x (mean + step x shape) to the pixels of each piece by Gauss-Newton steps.

    `shape` gives from parameters (n, k), which are `least` (k,) or more, the drawing S (n, m) between -1 and 1, and
    its derivatives (n, k, m). The light is a plane, 1 at the piece's origin. What the camera clips, the drawing
    clips as well. The covariance is that of the grey values' scatter about the drawing, of rounding at the least.
    A step in which no shape changes by more than `still` is the last.
    """
    lowest, highest = picture.extremes
    n, k = start.shape
    x, y, used = patches.x, patches.y, patches.used
    drawn, slopes = shape(start)
    expected = np.concatenate([np.zeros((n, k + 2)), light.slopes], axis=1)
    fitted = np.concatenate([start, _levels(drawn, patches), light.slopes], axis=1)
    prior = np.zeros(k + 4)
    prior[k + 2 :] = (picture.noise / light.std) ** 2
    rows = np.empty((n, k + 5, used.shape[1]), dtype=np.float32)
    by_shape, by_mean, by_step, by_light, residuals = np.split(rows, [k, k + 1, k + 2, k + 4], axis=1)
    for _ in range(MOST_STEPS):
        mean, step, along_x, along_y = fitted[:, k:].T[..., None].astype(np.float32)
        lit, reflected = along_x * x, step * drawn
        lit += along_y * y
        lit += 1
        reflected += mean
        model = lit * reflected
        seen = np.clip(model, lowest, highest)
        counted = np.equal(seen, model, out=model)
        counted *= used
        lit *= counted
        reflected *= counted
        by_mean[:, 0] = lit
        np.multiply(drawn, lit, out=by_step[:, 0])
        lit *= step
        np.multiply(slopes, lit[:, None], out=by_shape)
        np.multiply(x, reflected, out=by_light[:, 0])
        np.multiply(y, reflected, out=by_light[:, 1])
        np.subtract(patches.values, seen, out=residuals[:, 0])
        residuals[:, 0] *= used
        # numpy takes several times as long for a product of the jacobian with itself.
        equations = (rows[:, :-1] @ rows.swapaxes(1, 2)).astype(np.float64)
        normal = equations[..., :-1] + np.diag(prior)
        # A piece without contrast has no shape to speak of; it must not keep the others from theirs.
        normal += (1e-6 * np.diagonal(normal, axis1=1, axis2=2)[:, None] + 1e-9) * np.eye(k + 4)
        right = equations[..., -1] - prior * (fitted - expected)
        change = np.linalg.solve(normal, right[..., None])[..., 0]
        before = fitted[:, :k]
        fitted = fitted + change
        fitted[:, :k] = np.maximum(before + np.clip(change[:, :k], -LONGEST_STEP, LONGEST_STEP), least)
        moved = np.abs(fitted[:, :k] - before).max(axis=1)
        if moved.max(initial=0.0) < still:
            break
        drawn, slopes = shape(fitted[:, :k])
    freedom = np.maximum(used.sum(axis=1) - (k + 4), 1)
    squares = (residuals @ residuals.swapaxes(1, 2))[:, 0, 0]
    variance = np.maximum(squares / freedom, ROUNDING_VARIANCE)
    covariances = variance[:, None, None] * np.linalg.inv(normal)[:, :k, :k]
    converged = (moved < 5 * STANDS_STILL) & np.isfinite(fitted).all(axis=1)
    return GreyFit(fitted[:, :k], covariances, fitted[:, k], fitted[:, k + 1], np.sqrt(variance), converged)


def _levels(drawn: Singles, patches: Patches) -> Floats:
    """Fit mean and step (n, 2) of each piece to the drawing at its start."""
    count = np.maximum(patches.used.sum(axis=1), 1)
    mean_drawn = (patches.used * drawn).sum(axis=1) / count
    mean_value = (patches.used * patches.values).sum(axis=1) / count
    spread = patches.used * (drawn - mean_drawn[:, None])
    step = (spread * patches.values).sum(axis=1) / np.maximum((spread * drawn).sum(axis=1), 1e-9)
    return np.column_stack([mean_value - step * mean_drawn, step])
