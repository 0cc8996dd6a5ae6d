"""How noisy each kind of measurement is seen to be: points, given poses, and what else scatters the views."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.likelihood.blocks import said_of_poses
from calib.likelihood.measurements import PointViews
from calib.likelihood.outliers import Freed, Given, Misfits, freed_views, misfits, point_noise
from calib.likelihood.problem import Estimate, GroupTerms, Problem, Weights, all_in, evaluate
from calib.likelihood.scatter import PoseMisfit, Scatter, estimated_scatter

Array = NDArray[np.float64]

LEAST_POINT_NOISE = 1e-5
LEAST_POSE_NOISE = 1e-9
"""In px, and in rad and m: better is not measured, and what was made up may be exact to rounding."""
FEWEST_POINTS = 4
"""Points that a view must have kept to say where its camera was."""
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
    read = evaluate(problem, as_read, all_in(problem))
    freed = freed_views(problem, read.terms)
    sizes = _sizes(problem, estimate, freed, weights)
    groups = [
        replace(group, data=replace(group.data, whitening=group.data.whitening / size[..., None]))
        for group, size in zip(problem.groups, sizes, strict=True)
    ]
    scaled = replace(problem, groups=tuple(groups))
    if unknown is not None:
        scatter = _scatter(scaled, read.terms, sizes, weights, unknown)
        scaled = replace(scaled, reading_std=scatter.readings, looseness=scatter.looseness)
    freed = [view.rescaled(size) for view, size in zip(freed, sizes, strict=True)]
    found = misfits(scaled, read.terms, freed, weights, covariance)
    return scaled, found, _much_the_same(problem, scaled)


def _sizes(
    problem: Problem, estimate: Estimate, freed: Sequence[Freed | Given], weights: Weights
) -> list[Array]:
    """Return each group's standard deviations of whitened measurements: one of points (), six of given poses (6,)."""
    if any(isinstance(view, Given) for view in freed) and estimate.reading_errors.any():
        # The noise of poses is what is left when the readings have taken their share.
        freed = freed_views(problem, evaluate(problem, estimate, all_in(problem)).terms)
    spent, sizes = int(problem.free.sum()), []
    for group, view, weight in zip(problem.groups, freed, weights.groups, strict=True):
        if isinstance(group.data, PointViews):
            least = LEAST_POINT_NOISE * np.median(group.data.whitening[..., 0, 0])
            sizes.append(np.maximum(point_noise(view.left, group.data.present), least))
        else:
            assert isinstance(view, Given)
            smallest = LEAST_POSE_NOISE * np.diag(group.data.whitening)
            sizes.append(np.hypot(_pose_sizes(view.residuals, weight, spent), smallest))
    return sizes


def _pose_sizes(residuals: Array, weight: Array, spent: int) -> Array:
    """Return the sizes (6,) of pose residuals (n, 6), of which `spent` numbers were fitted away.

    Rotations and positions have one each: more cannot be told from a few dozen poses without being misled.
    """
    freedom = max((int((weight > 0).sum()) - spent) / 6, 1.0)
    variance = (weight * residuals**2).sum(axis=0) / freedom
    return np.asarray(np.sqrt(np.repeat(variance.reshape(2, 3).mean(axis=1), 3)))


def _scatter(
    problem: Problem,
    terms: Sequence[GroupTerms],
    sizes: Sequence[Array],
    weights: Weights,
    unknown: NDArray[np.bool_],
) -> Scatter:
    """Return what scatters the views, measurements being as noisy as `sizes` say.

    In `terms` everything counts and readings are taken as they were read.
    """
    misfits = []
    for group, own, size, weight in zip(problem.groups, terms, sizes, weights.groups, strict=True):
        points = isinstance(group.data, PointViews)
        kept = (weight > 0).sum(axis=1) >= (FEWEST_POINTS if points else 1)
        information, gradient = said_of_poses(own.blocks, weight / size**2)
        misfits.append(
            PoseMisfit(
                information=information[kept],
                gradient=gradient[kept],
                by_reading=own.chain.by_reading[kept],
                loose=points,
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
