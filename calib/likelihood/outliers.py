"""Measurements that do not belong: knocked views and bad detections are named and set aside, not averaged in.

Each view's pose is freed, robustly against its own bad points, and it is asked how far the chain's prediction is from
it: a view whose readings are wrong is far off. What then remains at a point tells a bad detection. Both are judged
against the median of all, so that neither the noise's size nor a few outliers matter.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from calib.likelihood.blocks import Blocks
from calib.likelihood.measurements import PointViews
from calib.likelihood.problem import Evaluation, Problem, Weights, all_in

Array = NDArray[np.float64]

RARE = 1e-5
"""How rarely a good measurement may be set aside."""
TUKEY = 4.685
FREEING_PASSES = 10
STUDENT = 4.0
"""Degrees of freedom of given poses' errors: other systems have longer tails than a picture's points."""
EXACT = 0.1
LEAST_POINT_NOISE = 1e-5
"""In px, or of what a covariance says: better is not measured, and made-up points may be exact."""
MEDIAN_OF_TWO = float(chi2.median(2))
MEDIAN_OF_SIX = float(chi2.median(6))


@dataclass(frozen=True)
class SetAside:
    """What was set aside: views by their places in the session, and points as (view, id)."""

    views: tuple[int, ...] = ()
    points: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, eq=False)
class Freed:
    """Views whose pose was freed: `shift` (n, 6) away from the prediction, known with `information` (n, 6, 6).

    `left` (n, q) are the squared misfits of the points that remain.
    """

    shift: Array
    information: Array
    left: Array

    def distance(self, by_reading: Array, std: Array) -> Array:
        """Return the squared distances (n,) of the shifts in terms of what their noise, and the readings', explains."""
        spread = by_reading * std
        covariance = np.linalg.inv(self.information) + spread @ np.swapaxes(spread, 1, 2)
        reach = np.linalg.solve(covariance, self.shift[..., None])[..., 0]
        return np.asarray((self.shift * reach).sum(axis=1))


@dataclass(frozen=True, eq=False)
class Misfits:
    """How far each group's views are from the prediction, `distances` (n,) squared, and their points' `left` (n, q).

    Both are in units of what noise makes of them: `noise` for points, `spread` for views, by their medians.
    """

    distances: tuple[Array, ...]
    left: tuple[Array, ...]
    noise: float
    spread: float


def misfits(problem: Problem, evaluation: Evaluation) -> Misfits:
    """Return the misfits at an evaluation in which everything counts and readings are taken as they were read."""
    present = all_in(problem).groups
    freed = [
        _freed(terms.blocks, weight) if isinstance(group.data, PointViews) else _given(terms.blocks)
        for group, terms, weight in zip(problem.groups, evaluation.terms, present, strict=True)
    ]
    distances = [
        np.nan_to_num(view.distance(terms.chain.by_reading, problem.reading_std), nan=np.inf)
        for view, terms in zip(freed, evaluation.terms, strict=True)
    ]
    points = [view.left[weight > 0] for view, weight in zip(freed, present, strict=True) if view.left.size]
    # Whitened misfits are about 1, and far less only where the measurements are exact to rounding.
    noise = max(float(np.nanmedian(np.concatenate(points))) / MEDIAN_OF_TWO if points else 0.0, EXACT)
    spread = float(np.median(np.concatenate(distances))) / MEDIAN_OF_SIX
    return Misfits(tuple(distances), tuple(view.left for view in freed), noise, max(noise, spread))


def without_bad_points(problem: Problem, found: Misfits) -> Weights:
    """Return weights with which all views count, without their bad points."""
    return judged(problem, replace(found, spread=np.inf))[0]


def softened(problem: Problem, found: Misfits) -> Weights:
    """Return Cauchy's weights of whole views, and no bad points: a first idea, while the chain itself is still off."""
    groups = []
    for weight, distance in zip(without_bad_points(problem, found).groups, found.distances, strict=True):
        soft = 1 / (1 + distance / (6 * found.spread))
        groups.append(weight * soft.reshape(-1, *[1] * (weight.ndim - 1)))
    return Weights(tuple(groups))


def judged(problem: Problem, found: Misfits) -> tuple[Weights, SetAside]:
    """Return weights without the outliers, and what these are."""
    knocked: list[int] = []
    bad: list[tuple[int, int]] = []
    groups = []
    for group, base, left, distance in zip(
        problem.groups, all_in(problem).groups, found.left, found.distances, strict=True
    ):
        # A view that the prediction puts behind the camera has no distance at all.
        out = ~(distance <= chi2.isf(RARE, 6) * found.spread)
        knocked += group.data.views[out].tolist()
        if not isinstance(group.data, PointViews):
            groups.append(np.where(out, 0.0, base * (STUDENT + 6) / (STUDENT + distance)))
            continue
        wrong = ~(left <= chi2.isf(RARE, 2) * found.noise) & (base > 0)
        rows, columns = np.nonzero(wrong & ~out[:, None])
        bad += zip(group.data.views[rows].tolist(), group.data.ids[rows, columns].tolist(), strict=True)
        groups.append(np.where(wrong | out[:, None], 0.0, base))
    return Weights(tuple(groups)), SetAside(tuple(sorted(knocked)), tuple(sorted(bad)))


def point_noise(blocks: Blocks, present: Array) -> float:
    """Return the standard deviation of a whitened point measurement, from misfits with each view's pose free.

    Bad points are left out, so that what remains is a truncated noise: the few good ones lost do not matter.
    """
    left = _freed(blocks, present).left
    first = float(np.nanmedian(left[present > 0])) / MEDIAN_OF_TWO
    good = (present > 0) & (left < chi2.isf(RARE, 2) * first)
    freedom = 2 * good.sum() - 6 * len(left)
    return max(float(np.sqrt(left[good].sum() / max(freedom, 1))), LEAST_POINT_NOISE)


def _freed(blocks: Blocks, present: Array) -> Freed:
    """Free each view's pose by Tukey's regression, started from least absolute misfits."""
    flat, right = blocks.jacobian[:, :, :6], blocks.residuals.reshape(len(present), -1, 1)
    transposed, square = np.swapaxes(flat, 1, 2), _squares(right)
    weight = present / np.maximum(np.sqrt(square), 1e-12)
    for _ in range(FREEING_PASSES):
        weighted = transposed * np.repeat(weight, 2, axis=1)[:, None]
        shift = -np.linalg.solve(weighted @ flat, weighted @ right)
        square = _squares(right + flat @ shift)
        typical = np.maximum(_median(square, present), 1e-24)
        reach = TUKEY**2 / MEDIAN_OF_TWO * typical[:, None]
        weight = present * np.maximum(1 - square / reach, 0) ** 2
    kept = np.repeat(weight > 0, 2, axis=1)[:, None]
    return Freed(np.asarray(shift[..., 0], float), (transposed * kept) @ flat, square)


def _squares(misfits: Array) -> Array:
    """Return the squared misfits of points (n, q) from those of their coordinates (n, 2 q, 1)."""
    return np.asarray(misfits[:, ::2, 0] ** 2 + misfits[:, 1::2, 0] ** 2)


def _median(values: Array, present: Array) -> Array:
    """Return the median (n,) of those `values` (n, q) that are `present`."""
    ordered = np.sort(np.where(present > 0, values, np.inf), axis=1)
    middle = np.maximum(present.sum(axis=1).astype(int) - 1, 0) // 2
    return np.asarray(ordered[np.arange(len(ordered)), middle])


def _given(blocks: Blocks) -> Freed:
    """Return given poses as they are: the view has nothing beside them that could be bad."""
    shift = -np.linalg.solve(blocks.hessian[:, :6, :6], blocks.gradient[:, :6, None])[..., 0]
    return Freed(np.asarray(shift, float), blocks.hessian[:, :6, :6], np.zeros((0,)))
