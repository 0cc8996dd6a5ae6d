"""What may be imperfect: joints that are off by a rule, a plate that is not flat, a sensor that sees askew.

A fit has some of that free to move; what is new in it starts at zero.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from calib.corrections import Backlash, Correction, Coupling, OncePerTurn, regressors
from calib.likelihood.problem import Estimate, Problem
from calib.session import Session
from calib.sweeps import SAME_START
from calib.targets import target_points
from calib.warp import warp_shapes

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

FEWEST_STANDING = 3
"""Views in a row in which a joint stands, of which its side is asked for where it is not known."""
FEWEST_A_SIDE = 3
"""Views of a moving joint that must have come from either side: one alone may as well be wrong."""
FEWEST_A_SLIP = 3
"""Views before and after a slip: fewer may as well be wrong."""
LEAST_TURN = np.pi / 2
"""Of a joint's travel (rad): over less, a once-per-turn error looks like another scale."""


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


@dataclass(frozen=True)
class Slip:
    """Steps that a joint lost on its way to the session's view number `view`: added to its readings from there on.

    It belongs to the session and not to the rig: whoever homes the joint has its readings right again.
    """

    joint: int
    view: int

    kind: ClassVar[str] = "slip"

    @property
    def coefficients(self) -> tuple[str, ...]:
        """How far it slipped."""
        return (f"from.{self.view}",)

    def regressors(self, readings: Array, sides: Array) -> Array:
        """Return how much of each coefficient is added to the joint's readings (n, 1), of the whole session."""
        del sides
        return (np.arange(len(readings)) >= self.view)[:, None].astype(float)


Fitted = Play | OncePerTurn | Coupling | Slip


@dataclass(frozen=True)
class Slipped:
    """A joint's slip as it was found: by `size`, give or take `std`, on the way to a view, in reading units."""

    joint: int
    view: int
    size: float
    std: float


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
            if not isinstance(model, Slip):
                models.append(Backlash(model.joint) if isinstance(model, Play) else model)
                places += range(first, first + len(models[-1].coefficients))
            first += len(model.coefficients)
        return tuple(models), places

    def slipped(self, coefficients: Array, deviations: Array) -> tuple[Slipped, ...]:
        """Return the joints' slips in the order of their views; `coefficients` (k,) are the models'."""
        found, first = [], 0
        for model in self.models:
            if isinstance(model, Slip):
                size, std = float(coefficients[first]), float(deviations[first])
                found.append(Slipped(model.joint, model.view, size, std))
            first += len(model.coefficients)
        return tuple(sorted(found, key=lambda slip: (slip.view, slip.joint)))

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


def possible_slips(problem: Problem, has: Sequence[Fitted]) -> list[Slip]:
    """Return the slips that the fit's views could show: of joints on their way from one view to the next.

    On either side of each, and of those that the fit `has`, the joint is seen in some views.
    """
    found = []
    for joint in range(problem.readings.shape[1]):
        seen = np.sort(np.concatenate([group.data.views for group in problem.groups if group.link > joint]))
        readings = problem.readings[seen, joint]
        moved = np.abs(np.diff(readings)) > SAME_START * np.ptp(readings)
        own = [model.view for model in has if isinstance(model, Slip) and model.joint == joint]
        ends = [0, *np.searchsorted(seen, own), len(seen)]
        found += [
            Slip(joint, int(seen[place]))
            for place in np.flatnonzero(moved) + 1
            if min(abs(place - end) for end in ends) >= FEWEST_A_SLIP
        ]
    return found


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
