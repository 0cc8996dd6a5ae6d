"""The normal equations: every view's information, mapped to the parameters, its reading errors eliminated."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.likelihood.measurements import PointViews
from calib.likelihood.problem import Estimate, Evaluation, Group, GroupTerms, Problem, said

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Elimination:
    """A group's reading errors in terms of a step of the parameters: `offset` (n, j) + `slope` (n, j, p) step.

    j counts the noisy joints; `gain` is what the offset alone gains in twice the log-likelihood.
    """

    views: NDArray[np.intp]
    offset: Array
    slope: Array
    gain: float


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Half the cost near an estimate: `gradient` (p,) and `information` (p, p) with fixed parameters left at rest."""

    information: Array
    gradient: Array
    eliminations: tuple[Elimination, ...]


def normal_equations(problem: Problem, estimate: Estimate, evaluation: Evaluation) -> NormalEquations:
    """Return the normal equations of all groups and the prior."""
    information, gradient = problem.prior.copy(), problem.prior @ estimate.travel
    eliminations = []
    for group, terms in zip(problem.groups, evaluation.terms, strict=True):
        local = local_by_parameter(problem, group, terms)
        hessian, slope, elimination = without_reading_errors(problem, estimate, group, terms, local)
        # All views' rows together: one product of matrices.
        rows = local.reshape(-1, local.shape[-1])
        information += rows.T @ (hessian @ local).reshape(rows.shape)
        gradient += slope.ravel() @ rows
        eliminations.append(elimination)
    return NormalEquations(information, gradient, tuple(eliminations))


def local_by_parameter(problem: Problem, group: Group, terms: GroupTerms) -> Array:
    """Return how each view's local vector changes with the parameters (n, d, p)."""
    layout, by_pose = problem.layout, terms.chain.by_parameter
    if not isinstance(group.data, PointViews):
        count = layout.aspects.stop - layout.aspects.start
        local = np.zeros((len(by_pose), 6 + count, len(layout)))
        local[:, :6] = by_pose
        local[:, 6:, layout.aspects] = np.eye(count)
        return local
    lens, warp = layout.lenses[group.camera], layout.warp
    bent = 6 + lens.stop - lens.start
    local = np.zeros((len(by_pose), bent + warp.stop - warp.start, len(layout)))
    local[:, :6] = by_pose
    local[:, 6:bent, lens] = layout.lens_changes[group.camera]
    local[:, bent:, warp] = np.eye(warp.stop - warp.start)
    return local


def without_reading_errors(
    problem: Problem, estimate: Estimate, group: Group, terms: GroupTerms, local: Array
) -> tuple[Array, Array, Elimination]:
    """Return hessian (n, d, d) and gradient (n, d) with each view's reading errors at their best (Schur)."""
    views = group.data.views
    hessian, gradient, _ = said(problem, group, terms.blocks)
    noisy = np.flatnonzero(problem.reading_std[: group.link] > 0)
    if not len(noisy):
        nothing = np.zeros((len(views), 0))
        return (
            hessian,
            gradient,
            Elimination(views, nothing, np.zeros((*nothing.shape, len(problem.layout))), 0.0),
        )
    by_reading = terms.chain.by_reading[:, :, noisy]
    precision = problem.reading_std[noisy] ** -2.0
    transposed = np.swapaxes(by_reading, 1, 2)
    mixed = hessian[:, :, :6] @ by_reading
    own = transposed @ mixed[:, :6] + np.diag(precision)
    pull = (transposed @ gradient[:, :6, None])[..., 0] + precision * estimate.reading_errors[views][:, noisy]
    gain = np.linalg.solve(own, np.swapaxes(mixed, 1, 2))
    offset = -np.linalg.solve(own, pull[..., None])[..., 0]
    reduced = hessian - mixed @ gain
    slope = gradient + (mixed @ offset[..., None])[..., 0]
    return (
        reduced,
        slope,
        Elimination(views, np.asarray(offset, float), -gain @ local, -float((offset * pull).sum())),
    )
