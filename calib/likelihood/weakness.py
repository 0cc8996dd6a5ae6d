"""What the measurements leave in the dark: quantities known too badly, those that hide each other together.

Two quantities can't be told apart where knowing one would make the other at least twice better known: where their
errors correlate by sqrt(3) / 2 or more.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.likelihood.descent import Descent
from calib.likelihood.other_views import Change, information_of, other_views
from calib.likelihood.problem import Problem
from calib.likelihood.quantities import Quantity, quantities
from calib.likelihood.refinement import Refined
from calib.likelihood.state import State
from calib.likelihood.uncertainty import covariance_of
from calib.likelihood.usual import usual_rig
from calib.session import Session
from calib.targets import target_points

Array = NDArray[np.float64]

TOGETHER = float(np.sqrt(3) / 2)
ACCOMPLICE = 0.5
"""Standard deviation, in tolerances, from which on a quantity is named beside one that matters."""
MINOR = 0.1
"""Part of the worst known one's standard deviation, in tolerances, below which it is not named."""
NOT_AT_ALL = 10.0
"""Standard deviation, in tolerances, from which on figures mean nothing any more, those of all else included."""
WORTHWHILE = 1.2
"""How many times better known something must become for a change to be worth its while."""


@dataclass(frozen=True, eq=False)
class Known:
    """A quantity and its standard deviation, in units of its tolerance."""

    quantity: Quantity
    std: float


@dataclass(frozen=True)
class Advice:
    """A change of the plan, and how many times better the worst known of a weakness would be known."""

    change: Change
    gain: float


@dataclass(frozen=True, eq=False)
class Weakness:
    """Quantities that hide each other, or a single one, the worst known first; and what would help most, if anything.

    `undetermined` is said of what is so badly known that its figures mean nothing.
    """

    known: tuple[Known, ...]
    advice: Advice | None

    @property
    def undetermined(self) -> bool:
        """Whether the measurements do not tell it at all."""
        return self.known[0].std >= NOT_AT_ALL


def weaknesses(session: Session, fit: Refined) -> list[Weakness]:
    """Return what a fit leaves in the dark, the worst first, and what would help most against each."""
    problem, variance = fit.problem, fit.noise**2
    groups = _hiding_each_other(_asked(session, problem, fit.state), fit.covariance)
    if not groups:
        return []
    usual = usual_rig(problem, fit.descent, fit.weights)
    present = covariance_of(problem, usual.equations.information, variance)
    offered = _offered(session, problem, usual, variance)
    there = {(one.kind, one.owner): one for one in _asked(session, problem, usual.estimate.state)}
    found = []
    for group in groups:
        same = [there[one.quantity.kind, one.quantity.owner] for one in group]
        found.append(Weakness(tuple(group), _best(same, present, offered)))
    return found


def _asked(session: Session, problem: Problem, state: State) -> list[Quantity]:
    points = target_points(session.target)
    return quantities(
        problem,
        state,
        [joint.name for joint in session.joints],
        [camera.name for camera in session.cameras],
        points.mean(axis=0) if len(points) else np.zeros(3),
    )


def _hiding_each_other(asked: Sequence[Quantity], covariance: Array) -> list[list[Known]]:
    """Return the quantities that matter in groups, each with those that it can't be told apart from."""
    # No direction is known worse than all of a quantity's numbers together: most fits are done here.
    rows = np.concatenate([quantity.rows for quantity in asked])
    variances = np.einsum("kp,kp->k", rows @ covariance, rows)
    starts = np.cumsum([0, *(len(quantity.rows) for quantity in asked[:-1])])
    if np.add.reduceat(variances, starts).max(initial=0) < 1:
        return []
    known = [Known(quantity, quantity.std(covariance)) for quantity in asked]
    suspects = sorted((one for one in known if one.std >= ACCOMPLICE), key=lambda one: -one.std)
    if not suspects or suspects[0].std < 1:
        return []
    matters = NOT_AT_ALL if suspects[0].std >= NOT_AT_ALL else 1.0
    rows = np.array([one.quantity.worst(covariance) for one in suspects])
    shared = rows @ covariance @ rows.T
    deviations = np.sqrt(np.diag(shared))
    together = np.abs(shared) >= TOGETHER * np.outer(deviations, deviations)
    groups, told = [], np.zeros(len(suspects), dtype=bool)
    for leader, worst in enumerate(suspects):
        if told[leader] or worst.std < matters:
            continue
        members = np.flatnonzero(together[leader] & ~told)
        told[members] = True
        group = [suspects[index] for index in members.tolist()]
        groups.append([one for one in group if one.std >= MINOR * worst.std])
    return groups


def _offered(
    session: Session, problem: Problem, descent: Descent, variance: float
) -> list[tuple[Change, Array]]:
    """Return the changes that can be made, each with the covariance (p, p) that it would bring about."""
    offered = []
    for others in other_views(session, problem, descent.estimate.state):
        told = information_of(others, session, problem, descent.estimate)
        if told is not None:
            kept = descent.equations.information if others.plate is None else problem.prior
            offered.append((others.change, covariance_of(problem, kept + told, variance)))
    return offered


def _best(
    group: Sequence[Quantity], present: Array, offered: Sequence[tuple[Change, Array]]
) -> Advice | None:
    """Return the change after which the worst known of the group is known best."""
    before = max(one.std(present) for one in group)
    after = [max(one.std(covariance) for one in group) for _, covariance in offered]
    if not after:
        return None
    best = int(np.argmin(after))
    gain = before / max(after[best], 1e-300)
    return Advice(offered[best][0], gain) if gain >= WORTHWHILE else None
