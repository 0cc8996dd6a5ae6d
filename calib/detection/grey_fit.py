"""Fits of a drawing's grey values to the pixels round many points at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.detection.picture import Picture

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Shape = Callable[[Floats], tuple[Singles, Singles]]

MOST_STEPS = 12
STANDS_STILL = 0.01  # of a shape, in px, radians, or relative; each step leaves a tenth of the one before
LONGEST_STEP = 0.5  # the same, but at once
SHADING_STD = 0.005  # of the light a px; what a few pixels across an edge can't tell from its place
ROUNDING_VARIANCE = 1 / 12


@dataclass(frozen=True, eq=False)
class Patches:
    """The m pixels that each of n pieces is fitted to, as `x` and `y` (n, m) in px from the piece's origin.

    `values` (n, m) are their grey values; those with `used` (n, m) 0 fill up the rows and count for nothing.
    """

    x: Singles
    y: Singles
    values: Singles
    used: Singles


def patches_of(
    picture: Picture, origins: Floats, pixels: NDArray[np.int64], wanted: NDArray[np.bool_]
) -> Patches:
    """Take of each piece's pixels (n, q, 2) the wanted ones (n, q); offsets are from origins (n, 2)."""
    piece, which = np.nonzero(wanted)
    counts = wanted.sum(axis=1)
    place = np.arange(len(piece)) - np.repeat(np.cumsum(counts) - counts, counts)
    x, y, values, used = np.zeros((4, len(pixels), counts.max(initial=1)), dtype=np.float32)
    column, row = pixels[piece, which].T
    x[piece, place] = column - origins[piece, 0]
    y[piece, place] = row - origins[piece, 1]
    values[piece, place] = picture.values[row, column]
    used[piece, place] = 1
    return Patches(x, y, values, used)


@dataclass(frozen=True, eq=False)
class GreyFit:
    """Each piece's shape: `parameters` (n, k), their `covariances` (n, k, k), and which have `converged` (n,).

    `steps` (n,) are the differences in grey value between where the shape is 1 and where it is -1, halved.
    """

    parameters: Floats
    covariances: Floats
    steps: Floats
    converged: NDArray[np.bool_]


def fit_grey_values(picture: Picture, patches: Patches, shape: Shape, start: Floats) -> GreyFit:
    """Fit light x (mean + step x shape) to the pixels of each piece by Gauss-Newton steps.

    `shape` gives from parameters (n, k) the drawing S (n, m) between -1 and 1, and its derivatives (n, k, m).
    The light is a plane, 1 at the piece's origin. What the camera clips, the drawing clips as well. The
    covariance is that of the grey values' scatter about the drawing, of rounding at the least.
    """
    lowest, highest = picture.values.min(), picture.values.max()
    n, k = start.shape
    x, y, used = patches.x, patches.y, patches.used
    drawn, slopes = shape(start)
    fitted = np.concatenate([start, _levels(drawn, patches), np.zeros((n, 2))], axis=1)
    prior = np.zeros(k + 4)
    prior[k + 2 :] = (picture.noise / SHADING_STD) ** 2
    jacobian = np.empty((n, k + 4, used.shape[1]), dtype=np.float32)
    for _ in range(MOST_STEPS):
        mean, step, along_x, along_y = fitted[:, k:].T[..., None].astype(np.float32)
        light = 1 + along_x * x + along_y * y
        reflected = mean + step * drawn
        model = light * reflected
        counted = used * ((model > lowest) & (model < highest))
        np.multiply(slopes, (step * light * counted)[:, None], out=jacobian[:, :k])
        jacobian[:, k] = light * counted
        jacobian[:, k + 1] = drawn * jacobian[:, k]
        jacobian[:, k + 2] = x * reflected * counted
        jacobian[:, k + 3] = y * reflected * counted
        residuals = used * (patches.values - np.clip(model, lowest, highest))
        normal = (jacobian @ jacobian.swapaxes(1, 2)).astype(np.float64) + np.diag(prior)
        # A piece without contrast has no shape to speak of; it must not keep the others from theirs.
        normal += (1e-6 * np.diagonal(normal, axis1=1, axis2=2)[:, None] + 1e-9) * np.eye(k + 4)
        right = (jacobian @ residuals[..., None])[..., 0] - prior * fitted
        change = np.linalg.solve(normal, right[..., None])[..., 0]
        change[:, :k] = np.clip(change[:, :k], -LONGEST_STEP, LONGEST_STEP)
        fitted = fitted + change
        moved = np.abs(change[:, :k]).max(axis=1)
        if moved.max(initial=0.0) < STANDS_STILL:
            break
        drawn, slopes = shape(fitted[:, :k])
    freedom = np.maximum(used.sum(axis=1) - (k + 4), 1)
    variance = np.maximum(np.square(residuals).sum(axis=1) / freedom, ROUNDING_VARIANCE)
    covariances = variance[:, None, None] * np.linalg.inv(normal)[:, :k, :k]
    converged = (moved < 5 * STANDS_STILL) & np.isfinite(fitted).all(axis=1)
    return GreyFit(fitted[:, :k], covariances, fitted[:, k + 1], converged)


def _levels(drawn: Singles, patches: Patches) -> Floats:
    """Fit mean and step (n, 2) of each piece to the drawing at its start."""
    count = np.maximum(patches.used.sum(axis=1), 1)
    mean_drawn = (patches.used * drawn).sum(axis=1) / count
    mean_value = (patches.used * patches.values).sum(axis=1) / count
    spread = patches.used * (drawn - mean_drawn[:, None])
    step = (spread * patches.values).sum(axis=1) / np.maximum((spread * drawn).sum(axis=1), 1e-9)
    return np.column_stack([mean_value - step * mean_drawn, step])
