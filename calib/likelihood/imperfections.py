"""What may be imperfect, and what each correction would gain: joints that are off by a rule, a plate that is not flat.

A fit is widened by corrections that are still zero. What each would gain in twice the log-likelihood then follows from
one Newton step, the other parameters following: g' H^-1 g with all others eliminated. Joints are judged as if the
plate could bulge, and a sensor see askew, as they like, so that neither is taken for a joint's error.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from calib.corrections import Backlash, Correction, Coupling, OncePerTurn, regressors
from calib.likelihood.descent import Descent
from calib.likelihood.measurements import GivenPoses
from calib.likelihood.normal import NormalEquations, normal_equations
from calib.likelihood.outliers import SetAside, freed_views, misfits, softened
from calib.likelihood.problem import Estimate, Problem, Weights, all_in, evaluate
from calib.session import Session
from calib.sweeps import SAME_START
from calib.targets import target_points
from calib.warp import possible_warps, warp_shapes

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

FEWEST_STANDING = 3
"""Views in a row in which a joint stands, of which its side is asked for where it is not known."""
FEWEST_A_SIDE = 3
"""Views of a moving joint that must have come from either side: one alone may as well be wrong."""
LEAST_TURN = np.pi / 2
"""Of a joint's travel (rad): over less, a once-per-turn error looks like another scale."""
TOLD_APART = 1e-9
"""Part of a correction's information that the other parameters must leave it."""
UNTOLD = 1e-13
"""Part of the largest information of a direction that is no more than rounding."""


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
class Play:
    """A joint's backlash as it is fitted: with where it stood in its play while its side was not known.

    Each of `standing` are views in a row, by their places in the session. Their offsets are found along with the
    play and not stated: after homing, for one, an idle joint may stand anywhere in it.
    """

    joint: int
    standing: tuple[tuple[int, ...], ...]

    kind: ClassVar[str] = Backlash.kind

    @property
    def coefficients(self) -> tuple[str, ...]:
        """The half gap, and the offsets."""
        return (*Backlash.coefficients, *(f"standing.{views[0]}" for views in self.standing))

    def regressors(self, readings: Array, sides: Array) -> Array:
        """Return how much of each coefficient is added to the joint's readings (n, k), of the whole session."""
        views = np.arange(len(readings))
        return np.column_stack([sides[:, self.joint], *(np.isin(views, own) for own in self.standing)])


Fitted = Play | OncePerTurn | Coupling


@dataclass(frozen=True)
class Imperfections:
    """What is corrected: readings by `models`, the target's points by the shapes `warp`.

    `sensors` are the cameras whose given poses have an aspect.
    """

    models: tuple[Fitted, ...] = ()
    warp: tuple[str, ...] = ()
    sensors: tuple[int, ...] = ()

    def stated(self) -> tuple[tuple[Correction, ...], list[int]]:
        """Return the corrections that a calibration states, and the places of their coefficients among all."""
        models: list[Correction] = []
        places: list[int] = []
        first = 0
        for model in self.models:
            models.append(Backlash(model.joint) if isinstance(model, Play) else model)
            places += range(first, first + len(models[-1].coefficients))
            first += len(model.coefficients)
        return tuple(models), places

    def sides(self, about: Circumstances, coefficients: Array) -> Array:
        """Return the sides of approach (n, m), those that were not known being the nearest to where a joint stood."""
        sides, first = about.sides.copy(), 0
        for model in self.models:
            if isinstance(model, Play):
                half_gap, *offsets = coefficients[first : first + len(model.coefficients)].tolist()
                for views, offset in zip(model.standing, offsets, strict=True):
                    sides[list(views), model.joint] = np.clip(np.round(offset / (half_gap or np.inf)), -1, 1)
            first += len(model.coefficients)
        return sides


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

    Of one more, `values` is what the coefficients would be, about.
    """

    imperfections: Imperfections
    size: int
    gain: float
    values: tuple[float, ...] = ()


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


def possible_corrections(problem: Problem, estimate: Estimate, about: Circumstances) -> list[Fitted]:
    """Return the corrections of joints that the fit's views could show at all."""
    chain = estimate.state.chain
    found: list[Fitted] = []
    for joint, scale in enumerate(chain.scales):
        moving = _moving(problem, about, joint)
        sides = about.sides[moving, joint]
        if min((sides > 0).sum(), (sides < 0).sum()) >= FEWEST_A_SIDE:
            found.append(Play(joint, _standing(problem, about, joint)))
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


def _standing(problem: Problem, about: Circumstances, joint: int) -> tuple[tuple[int, ...], ...]:
    """Return the fit's views in a row, by place, in which an idle joint stands, its side not being known."""
    seen = np.sort(np.concatenate([group.data.views for group in problem.groups if group.link > joint]))
    readings, open_ = problem.readings[seen, joint], about.sides[seen, joint] == 0
    idle = open_ & ~np.isin(about.exercised[seen], (joint, -1))
    moved = np.abs(np.diff(readings, prepend=readings[:1])) > SAME_START * np.ptp(readings)
    runs = np.cumsum(moved | ~idle)
    own = [seen[(runs == run) & idle] for run in np.unique(runs[idle])]
    return tuple(tuple(views.tolist()) for views in own if len(views) >= FEWEST_STANDING)


def with_imperfections(
    problem: Problem, estimate: Estimate, about: Circumstances, has: Imperfections, wanted: Imperfections
) -> tuple[Problem, Estimate]:
    """Return the problem with what is `wanted` free to move instead of what it `has`, and the estimate likewise.

    What is in both keeps its coefficients; what is new starts at zero.
    """
    layout, state = problem.layout, estimate.state
    first, names = layout.corrections.start, _names(about, wanted)
    end = first + len(names)
    middle = first + sum(len(model.coefficients) for model in wanted.models)
    last = middle + len(wanted.warp)
    known = dict(zip(_names(about, has), [*state.corrections, *state.warp, *state.aspects], strict=True))
    values = np.zeros(end)
    values[first:] = [known.get(name, 0.0) for name in names]
    prior, travel = np.zeros((end, end)), np.zeros(end)
    prior[:first, :first], travel[:first] = problem.prior[:first, :first], estimate.travel[:first]
    changed = replace(
        problem,
        layout=replace(
            layout,
            names=(*layout.names[:first], *names),
            corrections=slice(first, middle),
            warp=slice(middle, last),
            aspects=slice(last, end),
        ),
        regressors=regressors(wanted.models, problem.readings, about.sides),
        bulges=warp_shapes(about.points, wanted.warp),
        free=np.concatenate([problem.free[:first], np.ones(len(names), dtype=bool)]),
        prior=prior,
        sensors=wanted.sensors,
    )
    state = replace(
        state, corrections=values[first:middle], warp=values[middle:last], aspects=values[last:end]
    )
    return changed, replace(estimate, state=state, travel=travel)


def _names(about: Circumstances, imperfections: Imperfections) -> list[str]:
    """Return what the coefficients are called."""
    names = []
    for model in imperfections.models:
        by = f" by {about.joints[model.by]}" if isinstance(model, Coupling) else ""
        names += [f"{about.joints[model.joint]}.{model.kind}{by}.{part}" for part in model.coefficients]
    names += [f"target.{shape}" for shape in imperfections.warp]
    return names + [f"aspect.{camera}" for camera in imperfections.sensors]


def promised(fit: Fit, about: Circumstances, has: Imperfections) -> list[Candidate]:
    """Return what each possible correction, and warp of the target, promises over a fit that `has` some already."""
    options = [
        m for m in possible_corrections(fit.problem, fit.descent.estimate, about) if not _among(m, has.models)
    ]
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
        found.append(bent.candidate(replace(has, models=(*has.models, model)), own))
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
    left_over = [
        (replace(has, models=(*has.models[:i], *has.models[i + 1 :])), len(model.coefficients))
        for i, model in enumerate(has.models)
    ]
    if has.warp:
        left_over.append((replace(has, warp=()), len(has.warp)))
    for camera in has.sensors:
        rest = tuple(other for other in has.sensors if other != camera)
        left_over.append((replace(has, sensors=rest), 1))
    found, column = [], 0
    for less, size in left_over:
        own = layout.corrections.start + np.arange(column, column + size)
        others = np.setdiff1d(np.flatnonzero(fit.problem.free), own)
        gain = Eliminated.of(fit.descent.equations, others).loss(own, values[column : column + size])
        found.append(Candidate(less, size, gain))
        column += size
    return found


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
