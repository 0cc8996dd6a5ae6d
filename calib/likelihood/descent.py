"""Levenberg and Marquardt's way down, which never returns a worse likelihood than it started from."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.errors import UnsolvableError
from calib.likelihood.blocks import out_of_date
from calib.likelihood.measurements import PointViews
from calib.likelihood.normal import NormalEquations, normal_equations
from calib.likelihood.problem import Estimate, Evaluation, Problem, Weights, evaluate, offsets_at

Array = NDArray[np.float64]

MOST_STEPS = 1000
"""Taken or refused: ten are usual, but where little is told, the way down is long, narrow and bent."""
MOST_ROUNDS = 5
CONVERGED = 1e-3
"""What a step gains in twice the log-likelihood below which a round is over: the next one gains far less."""
NOTHING = 1e-5
"""What a step must promise to be taken at all: a few thousandths of a standard deviation."""
MOST_DAMPING = 1e12
FAR = 0.1
"""What a step promises from which on it is worth the while to ask anew what centroids of disks are off by."""
OUT_OF_DATE = 1e-4
"""What doing so may gain at the end: a hundredth of a standard deviation."""
UNTOLD = 1e-24
"""Part of the largest information of a parameter that is no more than rounding."""


@dataclass(frozen=True, eq=False)
class Descent:
    """Where the way down ended, with the likelihood and its normal equations there."""

    estimate: Estimate
    evaluation: Evaluation
    equations: NormalEquations
    converged: bool


def descend(problem: Problem, start: Estimate, weights: Weights) -> Descent:
    """Return the most likely estimate that is found going down from `start`.

    What centroids of disks are off by is held while going down, and taken anew until it no longer matters. Raises
    UnsolvableError where no measurement counts.
    """
    if count_measurements(problem, weights) == 0:
        raise UnsolvableError(
            "no view agrees with the others and with what is held or known beforehand: "
            "are the readings, the target, and the values that are held right?"
        )
    descent = _round(problem, start, weights)
    for _ in range(MOST_ROUNDS):
        renewed = offsets_at(problem, descent.estimate)
        if _out_of_date(problem, descent.estimate.offsets, renewed) <= OUT_OF_DATE:
            break
        descent = _round(problem, replace(descent.estimate, offsets=renewed), weights)
    return descent


def _out_of_date(problem: Problem, held: Sequence[Array | None], renewed: Sequence[Array | None]) -> float:
    """Return what renewing offsets can gain at most in twice the log-likelihood."""
    return sum(
        out_of_date(group.data, old, new)
        for group, old, new in zip(problem.groups, held, renewed, strict=True)
        if isinstance(group.data, PointViews) and old is not None and new is not None
    )


def _round(problem: Problem, estimate: Estimate, weights: Weights) -> Descent:
    evaluation = evaluate(problem, estimate, weights)
    equations = normal_equations(problem, estimate, evaluation)
    damping, growth = 1e-6, 4.0
    for _ in range(MOST_STEPS):
        step = solve_damped(equations, problem.free, damping)
        gain = sum(each.gain for each in equations.eliminations) - float(step @ equations.gradient)
        if gain <= NOTHING or damping > MOST_DAMPING:
            return Descent(estimate, evaluation, equations, converged=True)
        candidate = stepped(problem, estimate, equations, step)
        if gain > FAR:
            candidate = replace(candidate, offsets=offsets_at(problem, candidate))
        there = evaluate(problem, candidate, weights)
        if not there.cost <= evaluation.cost:
            damping, growth = damping * growth, growth * 2
            continue
        estimate, evaluation = candidate, there
        equations = normal_equations(problem, estimate, evaluation)
        damping, growth = max(damping / 10, 1e-12), 4.0
        if gain <= CONVERGED:
            return Descent(estimate, evaluation, equations, converged=True)
    return Descent(estimate, evaluation, equations, converged=False)


def count_measurements(problem: Problem, weights: Weights) -> int:
    """Return how many numbers were measured and count: two a point, six a given pose."""
    return sum(
        (2 if isinstance(group.data, PointViews) else 1) * int((weight > 0).sum())
        for group, weight in zip(problem.groups, weights.groups, strict=True)
    )


def solve_damped(equations: NormalEquations, free: NDArray[np.bool_], damping: float) -> Array:
    """Return the step (p,) downwards, zero where nothing is free; units are taken out by the information's diagonal."""
    step = np.zeros(len(free))
    information = equations.information[np.ix_(free, free)]
    sizes = np.diag(information)
    # What nothing is measured of, all its views being set aside, has but rounding to go by: it stays.
    told = sizes > UNTOLD * sizes.max(initial=0.0)
    scale = np.where(told, 1 / np.sqrt(np.where(told, sizes, 1.0)), 0.0)
    scaled = information * np.outer(scale, scale) + damping * np.eye(len(scale))
    step[free] = -scale * np.linalg.lstsq(scaled, scale * equations.gradient[free], rcond=1e-14)[0]
    return step


def stepped(problem: Problem, estimate: Estimate, equations: NormalEquations, step: Array) -> Estimate:
    """Return the estimate after a step of the parameters, its reading errors following."""
    errors = estimate.reading_errors.copy()
    for group, elimination in zip(problem.groups, equations.eliminations, strict=True):
        noisy = np.flatnonzero(problem.reading_std[: group.link] > 0)
        errors[np.ix_(elimination.views, noisy)] += elimination.offset + elimination.slope @ step
    state, travel = estimate.state.moved(step, problem.layout), estimate.travel + step
    return replace(estimate, state=state, reading_errors=errors, travel=travel)
