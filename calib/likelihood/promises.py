"""What a correction would gain: from a fit in which it is still zero, by one Newton step.

What it would gain in twice the log-likelihood is g' H^-1 g with all other parameters eliminated, which follow.
Joints are judged as if the plate could bulge, and a sensor see askew, as they like, so that neither is taken for a
joint's error.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from calib.corrections import OncePerTurn
from calib.likelihood.descent import Descent
from calib.likelihood.imperfections import (
    Circumstances,
    Fitted,
    Imperfections,
    Slip,
    possible_corrections,
    possible_slips,
    with_imperfections,
)
from calib.likelihood.measurements import GivenPoses
from calib.likelihood.normal import NormalEquations, normal_equations
from calib.likelihood.outliers import SetAside, freed_views, misfits, softened
from calib.likelihood.problem import Estimate, Problem, Weights, all_in, evaluate
from calib.warp import possible_warps

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

TOLD_APART = 1e-9
"""Part of a correction's information that the other parameters must leave it."""
UNTOLD = 1e-13
"""Part of the largest information of a direction that is no more than rounding."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A fit to which nothing changes any more: its likelihood, what counts in it, and what was set aside."""

    problem: Problem
    weights: Weights
    aside: SetAside
    descent: Descent


@dataclass(frozen=True)
class Candidate:
    """Imperfections with one more, or one less, of `size` coefficients, and what these `gain` in 2 log L.

    Of one more, `values` is what the coefficients would be, about. `slip` is the one of a joint that it is about, None
    where it is about another imperfection.
    """

    imperfections: Imperfections
    size: int
    gain: float
    values: tuple[float, ...] = ()
    slip: Slip | None = None


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Normal equations with some parameters at their best, whatever the others are.

    All are in units `scale` (p,) in which the `information`'s diagonal is 1: what is left of it is the part that the
    eliminated parameters leave, of which `known` (p, r) spans what is known.
    """

    information: Array
    gradient: Array
    scale: Array
    known: Array

    @classmethod
    def of(cls, equations: NormalEquations, others: Ints) -> Self:
        """Return the equations with the parameters `others` eliminated."""
        scale = 1 / np.sqrt(np.maximum(np.diag(equations.information), 1e-300))
        information = equations.information * np.outer(scale, scale)
        values, vectors = np.linalg.eigh(information[np.ix_(others, others)])
        told = values > UNTOLD * max(values.max(initial=0), 1e-300)
        known = np.zeros((len(scale), int(told.sum())))
        known[others] = vectors[:, told] / np.sqrt(values[told])
        return cls(information, equations.gradient * scale, scale, known)

    def candidate(self, imperfections: Imperfections, own: Ints) -> Candidate:
        """Return what the parameters `own` promise, directions that are told apart from nothing left at rest."""
        values, vectors = np.linalg.eigh(self._left(own))
        told = values > TOLD_APART
        gradient = self.gradient[own] - self.information[own] @ self.known @ (self.known.T @ self.gradient)
        step = -vectors[:, told] @ ((vectors.T @ gradient)[told] / values[told])
        return Candidate(
            imperfections, len(own), -float(step @ gradient), tuple((step * self.scale[own]).tolist())
        )

    def loss(self, own: Ints, values: Array) -> float:
        """Return what is lost where the parameters `own` move from `values` to 0."""
        scaled = values / self.scale[own]
        return float(scaled @ self._left(own) @ scaled)

    def _left(self, own: Ints) -> Array:
        shared = self.information[own] @ self.known
        return np.asarray(self.information[np.ix_(own, own)] - shared @ shared.T)


def promised(fit: Fit, about: Circumstances, has: Imperfections) -> list[Candidate]:
    """Return what each possible correction, and warp of the target, promises over a fit that `has` some already."""
    possible = possible_corrections(fit.problem, fit.descent.estimate, about)
    options = [m for m in possible if not _among(m, has.models)]
    options += possible_slips(fit.problem, has.models)
    warps = [shapes for shapes in possible_warps(about.points) if set(shapes) > set(has.warp)]
    sensors = [camera for camera in _sensors(fit.problem) if camera not in has.sensors]
    every = Imperfections((*has.models, *options), warps[-1] if warps else has.warp, (*has.sensors, *sensors))
    problem, estimate = with_imperfections(fit.problem, fit.descent.estimate, about, has, every)
    evaluation = evaluate(problem, estimate, _lenient(fit, problem, estimate))
    equations = normal_equations(problem, estimate, evaluation)
    first = problem.layout.corrections.start + sum(len(model.coefficients) for model in has.models)
    tried, bulging = np.arange(first, problem.layout.corrections.stop), problem.layout.warp.start
    new = [bulging + index for index, shape in enumerate(every.warp) if shape not in has.warp]
    aspects = np.arange(problem.layout.aspects.stop - len(sensors), problem.layout.aspects.stop)
    settled = np.setdiff1d(np.flatnonzero(problem.free), tried)
    bent, flat = (
        Eliminated.of(equations, settled),
        Eliminated.of(equations, np.setdiff1d(settled, [*new, *aspects])),
    )
    found = []
    for model in options:
        own = first + np.arange(len(model.coefficients))
        candidate = bent.candidate(replace(has, models=(*has.models, model)), own)
        found.append(replace(candidate, slip=_slip(model)))
        first += len(own)
    for shapes in warps:
        own = np.array([bulging + every.warp.index(shape) for shape in shapes if shape not in has.warp])
        found.append(flat.candidate(replace(has, warp=shapes), own))
    for camera, place in zip(sensors, aspects, strict=True):
        found.append(flat.candidate(replace(has, sensors=(*has.sensors, camera)), np.array([place])))
    return found


def worths(fit: Fit, has: Imperfections) -> list[Candidate]:
    """Return what the fit would lose without each of the joint corrections, the warp, and each aspect that it `has`.

    Each is named by what would be left.
    """
    layout, state = fit.problem.layout, fit.descent.estimate.state
    values = np.concatenate([state.corrections, state.warp, state.aspects])
    left_over: list[tuple[Imperfections, int, Slip | None]] = [
        (
            replace(has, models=(*has.models[:i], *has.models[i + 1 :])),
            len(model.coefficients),
            _slip(model),
        )
        for i, model in enumerate(has.models)
    ]
    if has.warp:
        left_over.append((replace(has, warp=()), len(has.warp), None))
    for camera in has.sensors:
        rest = tuple(other for other in has.sensors if other != camera)
        left_over.append((replace(has, sensors=rest), 1, None))
    found, column = [], 0
    for less, size, slip in left_over:
        own = layout.corrections.start + np.arange(column, column + size)
        others = np.setdiff1d(np.flatnonzero(fit.problem.free), own)
        gain = Eliminated.of(fit.descent.equations, others).loss(own, values[column : column + size])
        found.append(Candidate(less, size, gain, slip=slip))
        column += size
    return found


def _slip(model: Fitted) -> Slip | None:
    return model if isinstance(model, Slip) else None


def _sensors(problem: Problem) -> list[int]:
    """Return the cameras whose poses another system gave."""
    return [group.camera for group in problem.groups if isinstance(group.data, GivenPoses)]


def _among(model: Fitted, models: Sequence[Fitted]) -> bool:
    """Whether there is such a correction already, be its period a little different."""
    if isinstance(model, OncePerTurn):
        return any(isinstance(m, OncePerTurn) and m.joint == model.joint for m in models)
    return model in models


def _lenient(fit: Fit, problem: Problem, estimate: Estimate) -> Weights:
    """Return the fit's weights, with the views it set aside counting a little: a correction may explain them."""
    if not fit.aside.views:
        return fit.weights
    as_read = replace(estimate, reading_errors=np.zeros_like(estimate.reading_errors))
    everything = evaluate(problem, as_read, all_in(problem))
    freed = freed_views(problem, everything.terms)
    found = misfits(problem, everything.terms, freed, all_in(problem), np.zeros_like(problem.prior))
    soft = softened(problem, found)
    groups = []
    for group, kept, little in zip(problem.groups, fit.weights.groups, soft.groups, strict=True):
        out = np.isin(group.data.views, fit.aside.views)
        groups.append(np.where(out[:, None], little, kept))
    return Weights(tuple(groups))
