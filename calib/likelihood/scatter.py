"""What scatters the views about the chain: readings that are noisy, and what neither points nor readings explain.

With a view's pose free, its points tell the noise of pictures; how far the chain's prediction then is from that
pose tells the rest: along what the joints can do, the noise of their readings; every way alike, whatever else the model
leaves out, such as a bending arm. Each is taken for real only where the likelihood gains more than chance would
give it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, minimize

Array = NDArray[np.float64]

SUSPICIOUS = 3.0
FARTHEST = 20.0
"""How far the logarithm of a variance may be from where it starts."""
GAIN = 10.0
"""What twice the log-likelihood must gain for a joint's readings, or the views' poses, to count as noisy."""


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

    def misfit(self, variances: Array) -> tuple[float, Array]:
        """Return minus twice the log-likelihood and its derivatives by the variances (m + 1,), looseness last."""
        spread = self.arms * np.sqrt(variances[:-1])
        covariance = spread @ np.swapaxes(spread, 1, 2)
        covariance += (1 + variances[-1] * self.loose)[:, None, None] * np.eye(6)
        inverse = np.linalg.inv(covariance)
        pull = (inverse @ self.away[..., None])[..., 0]
        cost = np.linalg.slogdet(covariance)[1].sum() + (self.away * pull).sum()
        by_joint = ((inverse @ self.arms) * self.arms).sum(axis=(0, 1))
        by_joint -= (np.einsum("nkm,nk->nm", self.arms, pull) ** 2).sum(axis=0)
        own = np.trace(inverse, axis1=1, axis2=2) - (pull**2).sum(axis=1)
        return float(cost), np.append(by_joint, self.loose @ own)


def estimated_scatter(misfits: Sequence[PoseMisfit], known: Array, unknown: NDArray[np.bool_]) -> Scatter:
    """Return the scatter that makes the misfits most likely; a part that does not pay is 0.

    `known` (m,) are standard deviations of readings, taken as they are except where `unknown`.
    """
    views = _Views.of(misfits)
    variances = np.append(np.where(unknown, 0.0, known**2), 0.0)
    free = np.append(unknown, views.loose.any()) & (_suspicion(views) > SUSPICIOUS)
    start = _resolved(views)
    best, variances = _optimised(views, np.where(free, start, variances), free)
    while free.any():
        without = []
        for part in np.flatnonzero(free):
            fewer = free.copy()
            fewer[part] = False
            left = np.where(np.arange(len(free)) == part, 0.0, variances)
            without.append((*_optimised(views, left, fewer), fewer))
        cost, fitted, fewer = min(without, key=lambda each: each[0])
        if cost - best > GAIN:
            break
        best, variances, free = cost, fitted, fewer
    return Scatter(np.sqrt(variances[:-1]), float(variances[-1]))


def _suspicion(views: _Views) -> Array:
    """Return by how many of its standard deviations (m + 1,) the slope of the likelihood speaks for each variance.

    The slope at zero costs next to nothing, and in most sessions it says that there is none.
    """
    own = (views.arms**2).sum(axis=1)
    pull = np.einsum("nkm,nk->nm", views.arms, views.away) ** 2 - own
    spare = views.loose * ((views.away**2).sum(axis=1) - 6)
    slope = np.append(pull.sum(axis=0), spare.sum())
    spread = np.append((own**2).sum(axis=0), 6 * views.loose.sum())
    return np.asarray(slope / np.sqrt(2 * spread + 1e-300))


def _resolved(views: _Views) -> Array:
    """Return the variances (m + 1,) that a single view would just show: of readings one in which the joint moved."""
    seen = (views.arms**2).sum(axis=1)
    # A joint moves in some of the views only: in the others its reading is a mean, which shows less.
    return np.append(1 / np.maximum(np.quantile(seen, 0.9, axis=0), 1e-300), 1.0)


def _optimised(views: _Views, start: Array, free: NDArray[np.bool_]) -> tuple[float, Array]:
    """Return the least misfit over the `free` variances, by their logarithms, and the variances there."""
    variances = start.copy()

    def misfit(logarithms: Any) -> tuple[float, Array]:
        variances[free] = np.exp(logarithms)
        cost, slopes = views.misfit(variances)
        return cost, slopes[free] * variances[free]

    if free.any():
        first = np.log(np.maximum(start[free], 1e-300))
        bounds = Bounds(first - FARTHEST, first + FARTHEST)
        found = minimize(misfit, first, jac=True, method="L-BFGS-B", bounds=bounds)
        variances[free] = np.exp(found.x)
    return views.misfit(variances)[0], variances
