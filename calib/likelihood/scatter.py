"""What scatters the views about the chain: readings that are noisy, and what neither points nor readings explain.

With a view's pose free, its points tell the noise of pictures; how far the chain's prediction is then from that
pose tells the rest: along what the joints can do, the noise of their readings; every way alike, whatever else the model
leaves out, such as a bending arm. Each is taken for real only where the likelihood gains more than chance would
give it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Array = NDArray[np.float64]

SUSPICIOUS = 3.0
"""By how many of its standard deviations the likelihood must rise with a variance for it to be asked for."""
GAIN = 10.0
"""What twice the log-likelihood must gain for a joint's readings, or the views' poses, to count as noisy."""
CONVERGED = 1e-4
"""What twice the log-likelihood may still gain where variances are at their best."""
MOST_STEPS = 100
MOST_HALVINGS = 20


@dataclass(frozen=True, eq=False)
class PoseMisfit:
    """What n views say about their pose, with the readings taken as they were read.

    `information` (n, 6, 6) and `gradient` (n, 6) are in units of the measurements' noise, `by_reading` (n, 6, m) is
    how the pose changes with the readings. `loose` tells whether their poses may scatter beyond their own noise:
    given poses have that in it.
    """

    information: Array
    gradient: Array
    by_reading: Array
    loose: bool


@dataclass(frozen=True, eq=False)
class Scatter:
    """Standard deviations `readings` (m,) of the joints' readings, in their units; and `looseness` of views' poses.

    That is how many times the covariance that a view's own points give its pose is to be added to it.
    """

    readings: Array
    looseness: float


@dataclass(frozen=True, eq=False)
class _Squares:
    """All views' misfits, whitened by the covariance that some variances give them, times themselves transposed.

    Their expectation is the identity: `beyond` (36 n,) is what they are more than that, `by_variance` (36 n, m + 1)
    what they should be more with a larger variance. Minus twice the log-likelihood is `misfit`. Its derivatives by the
    variances are −by_varianceᵀ beyond, its second ones about by_varianceᵀ by_variance.
    """

    misfit: float
    beyond: Array
    by_variance: Array


@dataclass(frozen=True, eq=False)
class _Views:
    """All views' misfits `away` (n, 6) in units of their noise, and what each variance adds to their covariance.

    Of a joint that is `arms` (n, 6, m) times itself transposed, of the looseness the identity for `loose` (n,) views.
    """

    away: Array
    arms: Array
    loose: Array

    @classmethod
    def of(cls, misfits: Sequence[PoseMisfit]) -> "_Views":
        away, arms, loose = [], [], []
        for views in misfits:
            factor = np.linalg.cholesky(views.information)
            away.append(-np.linalg.solve(factor, views.gradient[..., None])[..., 0])
            arms.append(np.swapaxes(factor, 1, 2) @ views.by_reading)
            loose.append(np.full(len(views.information), float(views.loose)))
        return cls(np.concatenate(away), np.concatenate(arms), np.concatenate(loose))

    def squares(self, variances: Array) -> _Squares:
        """Return what the misfits' squares are with these variances (m + 1,), the looseness last."""
        own = np.sqrt(1 + variances[-1] * self.loose)[:, None, None] * np.eye(6)
        # The covariance is never formed: where readings are very noisy, the points' own noise would be lost in it.
        parts = np.concatenate([np.swapaxes(self.arms * np.sqrt(variances[:-1]), 1, 2), own], axis=1)
        factor = np.swapaxes(np.linalg.qr(parts, mode="r"), 1, 2)
        whitening = np.linalg.inv(factor)
        away, arms = whitening @ self.away[..., None], whitening @ self.arms
        by_looseness = self.loose[:, None, None] * (whitening @ np.swapaxes(whitening, 1, 2))
        by_variance = np.concatenate([arms[:, :, None] * arms[:, None], by_looseness[..., None]], axis=3)
        logarithms = np.log(np.abs(np.diagonal(factor, axis1=1, axis2=2)))
        return _Squares(
            misfit=float(2 * logarithms.sum() + (away**2).sum()),
            beyond=(away @ np.swapaxes(away, 1, 2) - np.eye(6)).ravel(),
            by_variance=by_variance.reshape(-1, len(variances)),
        )


def estimated_scatter(misfits: Sequence[PoseMisfit], known: Array, unknown: NDArray[np.bool_]) -> Scatter:
    """Return the scatter that makes the misfits most likely; a part that does not pay is 0.

    `known` (m,) are standard deviations of readings, taken as they are except where `unknown`.
    """
    views = _Views.of(misfits)
    variances = np.append(np.where(unknown, 0.0, known**2), 0.0)
    free = np.append(unknown, True) & (_suspicion(views.squares(variances)) > SUSPICIOUS)
    best, variances = _optimised(views, variances, free)
    while (free := free & (variances > 0)).any():
        without = []
        for part in np.flatnonzero(free):
            fewer = free & (np.arange(len(free)) != part)
            left = np.where(free & ~fewer, 0.0, variances)
            without.append(_optimised(views, left, fewer))
        cost, fitted = min(without, key=lambda each: each[0])
        if cost - best > GAIN:
            break
        best, variances = cost, fitted
    return Scatter(np.sqrt(variances[:-1]), float(variances[-1]))


def _suspicion(squares: _Squares) -> Array:
    """Return by how many of its standard deviations (m + 1,) the slope of the likelihood speaks for each variance.

    The slope costs next to nothing, and in most sessions it says that there is none.
    """
    slope, information = squares.beyond @ squares.by_variance, (squares.by_variance**2).sum(axis=0)
    return np.asarray(slope / np.sqrt(2 * information + 1e-300))


def _optimised(views: _Views, start: Array, free: NDArray[np.bool_]) -> tuple[float, Array]:
    """Return the least misfit over the `free` variances, none of them negative, and the variances there.

    Fisher's scoring: each step is the least-squares fit of what the variances add to the squares, weighted by those
    before. A variance that it holds to be 0 is free to grow at the next step.
    """
    variances, squares = start, views.squares(start)
    for _ in range(MOST_STEPS if free.any() else 0):
        by_variance = squares.by_variance[:, free]
        size = np.linalg.norm(by_variance, axis=0)
        wanted = start.copy()
        wanted[free] = nnls(by_variance / size, squares.beyond + by_variance @ variances[free])[0] / size
        step = wanted - variances
        if squares.beyond @ squares.by_variance @ step < CONVERGED:
            break
        for halvings in range(MOST_HALVINGS):
            tried = variances + step / 2**halvings
            found = views.squares(tried)
            if found.misfit < squares.misfit:
                break
        else:
            break
        variances, squares = tried, found
    return squares.misfit, variances
