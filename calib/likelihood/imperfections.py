"""What may be imperfect, and what each correction would gain: joints that are off by a rule, a plate that is not flat.

A fit is widened by corrections that are still zero. What each would gain in twice the log-likelihood then follows from
one Newton step, the other parameters following: g' H^-1 g with all others eliminated. Joints are judged as if the
plate could bulge as it likes, so that no bulge is taken for a joint's error.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.corrections import Backlash, Correction, Coupling, OncePerTurn, regressors
from calib.likelihood.descent import Descent
from calib.likelihood.normal import NormalEquations, normal_equations
from calib.likelihood.outliers import SetAside, misfits, softened
from calib.likelihood.problem import Estimate, Problem, Weights, all_in, evaluate
from calib.session import Session
from calib.targets import target_points
from calib.warp import CUBIC, QUADRATIC, possible_shapes, warp_shapes

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

FEWEST_A_SIDE = 3
"""Views of a moving joint that must have come from either side: one alone may as well be wrong."""
LEAST_TURN = np.pi / 2
"""Of a joint's travel (rad): over less, a once-per-turn error looks like another scale."""
TOLD_APART = 1e-9
"""Part of a correction's information that the other parameters must leave it."""


@dataclass(frozen=True, eq=False)
class Circumstances:
    """What a session says beside its measurements.

    `sides` (n, m) are from which each joint approached its reading, 0 where not known, `exercised` (n,) the joint moved
    alone, -1 outside the plan, `joints` their names, and `points` (t, 3) the target's.
    """

    joints: tuple[str, ...]
    sides: Array
    exercised: Ints
    points: Array

    @classmethod
    def of(cls, session: Session) -> "Circumstances":
        """Return those of a session."""
        exercised = [-1 if v.joint is None else session.joint_index(v.joint) for v in session.views]
        return cls(
            joints=tuple(joint.name for joint in session.joints),
            sides=session.sides(),
            exercised=np.array(exercised, dtype=np.intp),
            points=target_points(session.target),
        )


@dataclass(frozen=True)
class Imperfections:
    """What is corrected: readings by `models`, the target's points by the shapes `warp`."""

    models: tuple[Correction, ...] = ()
    warp: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Fit:
    """A fit to which nothing changes any more: its likelihood, what counts in it, and what was set aside."""

    problem: Problem
    weights: Weights
    aside: SetAside
    descent: Descent


@dataclass(frozen=True)
class Candidate:
    """Imperfections with one more, or one less, of `size` coefficients, and what these `gain` in 2 log L."""

    imperfections: Imperfections
    size: int
    gain: float


def possible_corrections(problem: Problem, estimate: Estimate, about: Circumstances) -> list[Correction]:
    """Return the corrections of joints that the fit's views could show at all."""
    chain = estimate.state.chain
    found: list[Correction] = []
    for joint, scale in enumerate(chain.scales):
        moving = _moving(problem, about, joint)
        sides = about.sides[moving, joint]
        if min((sides > 0).sum(), (sides < 0).sum()) >= FEWEST_A_SIDE:
            found.append(Backlash(joint))
        travel = float(np.ptp(problem.readings[moving, joint])) if len(moving) else 0.0
        if chain.revolute[joint] and travel * scale > LEAST_TURN:
            found.append(OncePerTurn(joint, float(2 * np.pi / scale)))
        if travel > 0:
            found += [Coupling(other, joint) for other in range(len(chain)) if other != joint]
    return found


def _moving(problem: Problem, about: Circumstances, joint: int) -> Ints:
    """Return the fit's views in which a joint moves the camera, and is not idle."""
    seen = [group.data.views for group in problem.groups if group.link > joint]
    views = np.concatenate(seen) if seen else np.zeros(0, dtype=np.intp)
    return views[np.isin(about.exercised[views], (joint, -1))]


def with_imperfections(
    problem: Problem, estimate: Estimate, about: Circumstances, has: Imperfections, wanted: Imperfections
) -> tuple[Problem, Estimate]:
    """Return the problem with what is `wanted` free to move instead of what it `has`, and the estimate likewise.

    What is in both keeps its coefficients; what is new starts at zero.
    """
    layout, state = problem.layout, estimate.state
    first, names = layout.corrections.start, _names(about, wanted)
    middle, end = first + sum(len(model.coefficients) for model in wanted.models), first + len(names)
    known = dict(zip(_names(about, has), [*state.corrections, *state.warp], strict=True))
    values = np.array([known.get(name, 0.0) for name in names])
    prior, travel = np.zeros((end, end)), np.zeros(end)
    prior[:first, :first], travel[:first] = problem.prior[:first, :first], estimate.travel[:first]
    changed = replace(
        problem,
        layout=replace(
            layout,
            names=(*layout.names[:first], *names),
            corrections=slice(first, middle),
            warp=slice(middle, end),
        ),
        regressors=regressors(wanted.models, problem.readings, about.sides),
        bulges=warp_shapes(about.points, wanted.warp),
        free=np.concatenate([problem.free[:first], np.ones(len(names), dtype=bool)]),
        prior=prior,
    )
    state = replace(state, corrections=values[: middle - first], warp=values[middle - first :])
    return changed, replace(estimate, state=state, travel=travel)


def _names(about: Circumstances, imperfections: Imperfections) -> list[str]:
    """Return what the coefficients are called."""
    names = []
    for model in imperfections.models:
        by = f" by {about.joints[model.by]}" if isinstance(model, Coupling) else ""
        names += [f"{about.joints[model.joint]}.{model.kind}{by}.{part}" for part in model.coefficients]
    return names + [f"target.{shape}" for shape in imperfections.warp]


def promised(fit: Fit, about: Circumstances, has: Imperfections) -> list[Candidate]:
    """Return what each possible correction promises over the fit, which `has` some already, the best first."""
    options = [
        m for m in possible_corrections(fit.problem, fit.descent.estimate, about) if not _among(m, has.models)
    ]
    shapes = [s for s in possible_shapes(about.points, (*QUADRATIC, *CUBIC)) if s not in has.warp]
    every = Imperfections((*has.models, *options), (*has.warp, *shapes))
    problem, estimate = with_imperfections(fit.problem, fit.descent.estimate, about, has, every)
    evaluation = evaluate(problem, estimate, _lenient(fit, problem, estimate))
    equations = normal_equations(problem, estimate, evaluation)
    first = problem.layout.corrections.start + sum(len(model.coefficients) for model in has.models)
    tried, bulging = np.arange(first, problem.layout.corrections.stop), problem.layout.warp
    bulges = np.arange(bulging.start + len(has.warp), bulging.stop)
    others = np.setdiff1d(np.flatnonzero(problem.free), tried)
    left, pull = _eliminated(equations, others, tried)
    found, column = [], 0
    for model in options:
        own = slice(column, column + len(model.coefficients))
        gain = _gain(left[own, own], pull[own])
        found.append(Candidate(replace(has, models=(*has.models, model)), own.stop - own.start, gain))
        column = own.stop
    own_shapes = [s for s in shapes if len(s) == min(map(len, shapes))]
    if own_shapes:
        left, pull = _eliminated(equations, np.setdiff1d(others, bulges), bulges[: len(own_shapes)])
        warped = replace(has, warp=(*has.warp, *own_shapes))
        found.append(Candidate(warped, len(own_shapes), _gain(left, pull)))
    return sorted(found, key=lambda candidate: -candidate.gain)


def worths(fit: Fit, has: Imperfections) -> list[Candidate]:
    """Return what the fit would lose without each of the joint corrections, and without the warp, that it `has`.

    Each is named by what would be left.
    """
    layout, state = fit.problem.layout, fit.descent.estimate.state
    values = np.concatenate([state.corrections, state.warp])
    left_over = [
        (replace(has, models=(*has.models[:i], *has.models[i + 1 :])), len(model.coefficients))
        for i, model in enumerate(has.models)
    ]
    if has.warp:
        left_over.append((replace(has, warp=()), len(has.warp)))
    found, column = [], 0
    for less, size in left_over:
        own = layout.corrections.start + np.arange(column, column + size)
        others = np.setdiff1d(np.flatnonzero(fit.problem.free), own)
        information, _ = _eliminated(fit.descent.equations, others, own)
        scaled = values[column : column + size] * np.sqrt(np.diag(fit.descent.equations.information)[own])
        found.append(Candidate(less, size, float(scaled @ information @ scaled)))
        column += size
    return found


def _among(model: Correction, models: Sequence[Correction]) -> bool:
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
    soft = softened(problem, misfits(problem, everything, all_in(problem), np.zeros_like(problem.prior)))
    groups = []
    for group, kept, little in zip(problem.groups, fit.weights.groups, soft.groups, strict=True):
        out = np.isin(group.data.views, fit.aside.views)
        groups.append(np.where(out[:, None], little, kept))
    return Weights(tuple(groups))


def _eliminated(equations: NormalEquations, others: Ints, own: Ints) -> tuple[Array, Array]:
    """Return the information and gradient of parameters `own`, all `others` at their best.

    They are scaled so that the information's diagonal is the part that the others leave of it.
    """
    scale = 1 / np.sqrt(np.maximum(np.diag(equations.information), 1e-300))
    information, gradient = equations.information * np.outer(scale, scale), equations.gradient * scale
    values, vectors = np.linalg.eigh(information[np.ix_(others, others)])
    known = values > 1e-13 * max(values.max(initial=0), 1e-300)
    roots = vectors[:, known] / np.sqrt(values[known])
    shared = roots.T @ information[np.ix_(others, own)]
    left = information[np.ix_(own, own)] - shared.T @ shared
    return np.asarray(left), np.asarray(gradient[own] - shared.T @ (roots.T @ gradient[others]))


def _gain(information: Array, gradient: Array) -> float:
    """Return what parameters gain at their best, directions that are told apart from nothing left out."""
    values, vectors = np.linalg.eigh(information)
    told = values > TOLD_APART
    return float((((vectors.T @ gradient)[told]) ** 2 / values[told]).sum())
