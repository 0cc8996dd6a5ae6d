"""How noisy each kind of measurement is seen to be: points, given poses, and what else scatters the views."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.likelihood.measurements import GivenPoses, PointViews
from calib.likelihood.outliers import Misfits, misfits, point_noise
from calib.likelihood.problem import Estimate, Evaluation, Problem, Weights, all_in, evaluate
from calib.likelihood.scatter import PoseMisfit, Scatter, estimated_scatter

Array = NDArray[np.float64]

LEAST_POSE_NOISE = 1e-9
"""In rad and m: given poses may be exact to rounding."""
SETTLED = 0.02
"""Relative change of a standard deviation that no longer matters."""


def seen_noise(
    problem: Problem,
    estimate: Estimate,
    weights: Weights,
    covariance: Array,
    unknown: NDArray[np.bool_] | None = None,
) -> tuple[Problem, Misfits, bool]:
    """Return the problem with each noise as large as it is seen to be, the misfits, and whether that was so before.

    `covariance` (p, p) is that of the parameters, which matters for views that `weights` leave out. The scatter of
    views is asked for where it is said of which joints (m,) the readings' noise is `unknown`.
    """
    as_read = replace(estimate, reading_errors=np.zeros_like(estimate.reading_errors))
    there = evaluate(problem, estimate, all_in(problem))
    scaled = _with_measurement_noise(problem, there, weights)
    if unknown is not None:
        scatter = _scatter(scaled, evaluate(scaled, as_read, weights), weights, unknown)
        scaled = replace(scaled, reading_std=scatter.readings, looseness=scatter.looseness)
    found = misfits(scaled, evaluate(scaled, as_read, all_in(scaled)), weights, covariance)
    return scaled, found, _much_the_same(problem, scaled)


def _with_measurement_noise(problem: Problem, everything: Evaluation, weights: Weights) -> Problem:
    """Return the problem with whitenings under which misfits have unit variance."""
    spent = int(problem.free.sum())
    groups = []
    for group, terms, weight in zip(problem.groups, everything.terms, weights.groups, strict=True):
        if isinstance(group.data, PointViews):
            scale = point_noise(terms.blocks, group.data.present)
            data: PointViews | GivenPoses = replace(group.data, whitening=group.data.whitening / scale)
        else:
            residuals = terms.blocks.residuals[..., 0] @ np.linalg.inv(group.data.whitening).T
            data = replace(group.data, whitening=_whitening(np.asarray(residuals, float), weight, spent))
        groups.append(replace(group, data=data))
    return replace(problem, groups=tuple(groups))


def _whitening(residuals: Array, weight: Array, spent: int) -> Array:
    """Return the matrix (6, 6) that whitens pose residuals (n, 6), of which `spent` numbers were fitted away.

    Rotations and positions have a size each: more cannot be told from a few dozen poses without being misled.
    """
    freedom = max((int((weight > 0).sum()) - spent) / 6, 1.0)
    variance = (weight * residuals**2).sum(axis=0) / freedom
    sizes = np.repeat(variance.reshape(2, 3).mean(axis=1), 3)
    return np.diag(1 / np.sqrt(sizes + LEAST_POSE_NOISE**2))


def _scatter(problem: Problem, there: Evaluation, weights: Weights, unknown: NDArray[np.bool_]) -> Scatter:
    """Return what scatters the views; `there` is where the readings are taken as they were read."""
    misfits = []
    for group, terms, weight in zip(problem.groups, there.terms, weights.groups, strict=True):
        kept, blocks = weight.any(axis=1), terms.blocks
        misfits.append(
            PoseMisfit(
                information=blocks.hessian[kept, :6, :6],
                gradient=blocks.gradient[kept, :6],
                by_reading=terms.chain.by_reading[kept],
                loose=isinstance(group.data, PointViews),
            )
        )
    return estimated_scatter(misfits, problem.reading_std, unknown)


def _much_the_same(before: Problem, after: Problem) -> bool:
    """Whether the noise of two problems differs by little."""
    return bool(
        np.allclose(before.reading_std, after.reading_std, rtol=SETTLED)
        and np.isclose(1 + before.looseness, 1 + after.looseness, rtol=SETTLED)
        and all(
            np.abs(old.data.whitening - new.data.whitening).max() < SETTLED * np.abs(new.data.whitening).max()
            for old, new in zip(before.groups, after.groups, strict=True)
        )
    )
