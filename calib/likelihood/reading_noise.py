"""How noisy the joints' readings are, where nobody said: from how far apart views are that should agree.

With a view's pose free, its points tell the noise of pictures; how far the chain's prediction then is from that
pose, along what the joints can do, tells the noise of readings. It is taken for real only where the likelihood
gains more than chance would give it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

Array = NDArray[np.float64]

SUSPICIOUS = 3.0
FARTHEST = 12.0
"""How far the logarithm of a standard deviation may be from what a single view just shows."""
GAIN = 10.0
"""What twice the log-likelihood must gain for a joint's readings to count as noisy."""


@dataclass(frozen=True, eq=False)
class PoseMisfit:
    """What n views say about their pose, with the readings taken as they were read.

    `information` (n, 6, 6) and `gradient` (n, 6) are in units of the measurements' noise, `by_reading` (n, 6, m) is
    how the pose changes with the readings.
    """

    information: Array
    gradient: Array
    by_reading: Array


def estimated_reading_std(misfits: Sequence[PoseMisfit], known: Array, free: NDArray[np.bool_]) -> Array:
    """Return the standard deviations (m,) of readings that make the misfits most likely; `free` ones are estimated.

    `known` (m,) holds the others. A free one that does not pay is 0.
    """
    std = np.where(free, 0.0, known)
    free = free & (_suspicion(misfits) > SUSPICIOUS)
    start = np.where(free, _resolved(misfits), known)
    best = _misfit(misfits, std)
    for joint in np.flatnonzero(free):
        tried = np.zeros_like(free)
        tried[joint] = True
        candidate = _optimised(misfits, np.where(tried, start, std), tried | ((std > 0) & free))
        gained = _misfit(misfits, candidate)
        if best - gained > GAIN:
            std, best = candidate, gained
    return std


def _suspicion(misfits: Sequence[PoseMisfit]) -> Array:
    """Return by how many of its standard deviations (m,) the slope of the likelihood speaks for noisy readings.

    The slope by a variance at zero costs next to nothing, and in most sessions it says that there is none.
    """
    pull = np.concatenate([np.einsum("nkm,nk->nm", v.by_reading, v.gradient) for v in misfits])
    own = np.concatenate(
        [np.einsum("nkm,nkl,nlm->nm", v.by_reading, v.information, v.by_reading) for v in misfits]
    )
    return np.asarray((pull**2 - own).sum(axis=0) / np.sqrt(2 * (own**2).sum(axis=0) + 1e-300))


def _resolved(misfits: Sequence[PoseMisfit]) -> Array:
    """Return the reading error (m,) of each joint that a single view in which it moved would just show."""
    seen = np.concatenate(
        [np.einsum("nkm,nkl,nlm->nm", v.by_reading, v.information, v.by_reading) for v in misfits]
    )
    # A joint moves in some of the views only: in the others its reading is a mean, which shows less.
    return np.asarray(1 / np.sqrt(np.maximum(np.quantile(seen, 0.9, axis=0), 1e-300)))


def _optimised(misfits: Sequence[PoseMisfit], start: Array, free: NDArray[np.bool_]) -> Array:
    def cost(logarithms: Array) -> float:
        std = start.copy()
        std[free] = np.exp(np.clip(logarithms, first - FARTHEST, first + FARTHEST))
        return _misfit(misfits, std)

    first = np.log(start[free])
    found = minimize(cost, first, method="Nelder-Mead", options={"xatol": 0.02, "fatol": 0.05})
    std = start.copy()
    std[free] = np.exp(np.clip(found.x, first - FARTHEST, first + FARTHEST))
    return std


def _misfit(misfits: Sequence[PoseMisfit], std: Array) -> float:
    """Return minus twice the log-likelihood of the misfits, reading errors integrated out, up to a constant."""
    noisy = std > 0
    if not noisy.any():
        return 0.0
    total = 0.0
    for views in misfits:
        by_reading = views.by_reading[:, :, noisy] * std[noisy]
        transposed = np.swapaxes(by_reading, 1, 2)
        own = transposed @ views.information @ by_reading + np.eye(int(noisy.sum()))
        pull = (transposed @ views.gradient[..., None])[..., 0]
        gain = (pull * np.linalg.solve(own, pull[..., None])[..., 0]).sum()
        total += float(np.linalg.slogdet(own)[1].sum() - gain)
    return total
