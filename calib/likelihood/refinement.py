"""The whole fit: from the closed form to the most likely calibration, outliers set aside, noise found where unknown."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.errors import UnsolvableError
from calib.likelihood.building import Start, built
from calib.likelihood.descent import Descent, descend
from calib.likelihood.held_out import HeldOut, held_out
from calib.likelihood.idle import as_the_views_follow, resting
from calib.likelihood.imperfections import Imperfections
from calib.likelihood.lens_terms import lens_from_vector
from calib.likelihood.noise import seen_noise
from calib.likelihood.outliers import (
    SetAside,
    judged,
    softened,
    without_bad_points,
)
from calib.likelihood.predicted_miss import predicted_miss
from calib.likelihood.problem import (
    Estimate,
    Problem,
    Weights,
    all_in,
    evaluate,
)
from calib.likelihood.promises import Candidate, Fit
from calib.likelihood.selection import selected
from calib.likelihood.state import State
from calib.likelihood.uncertainty import noise_variance, step_covariance
from calib.observations import Observation
from calib.screws import stood_still
from calib.session import Intrinsics, Session

Array = NDArray[np.float64]

MOST_PASSES = 12
SOFT_PASSES = 5
LEAST_MOTION = 3.0
"""How many times its standard deviation a joint's scale must be, all else being known."""


@dataclass(frozen=True, eq=False)
class Refined:
    """The most likely calibration.

    `covariance` (p, p) is of a step of `problem.layout`'s parameters, `noise` the standard deviation of one
    measurement in units of what it was taken for.
    """

    problem: Problem
    weights: Weights
    descent: Descent
    covariance: Array
    noise: float
    set_aside: SetAside
    imperfections: Imperfections
    unused_warp: Candidate | None

    @property
    def state(self) -> State:
        """The parameters found."""
        return self.descent.estimate.state

    def lenses(self) -> list[Intrinsics | None]:
        """Return each camera's lens."""
        likes = {group.camera: group.lens for group in self.problem.groups if group.lens is not None}
        return [
            None if values is None else lens_from_vector(values, likes[camera])
            for camera, values in enumerate(self.state.lenses)
        ]

    def predicted_miss(self) -> float | None:
        """Return by how much points should lie from where they are predicted (rms, px)."""
        return predicted_miss(self.problem, self.weights, self.descent.evaluation, self.covariance)

    def held_out(self) -> list[HeldOut]:
        """Return how well each view is predicted by the fit of all others."""
        estimate = self.descent.estimate
        state = replace(estimate.state, rests=np.zeros_like(estimate.state.rests))
        as_read = replace(estimate, state=state, reading_errors=np.zeros_like(estimate.reading_errors))
        return held_out(
            self.problem,
            estimate,
            self.weights,
            self.descent.evaluation,
            evaluate(self.problem, as_read, self.weights),
            self.descent.equations.information,
        )


def refine(
    session: Session, observations: Sequence[Observation], start: Start, target_warp: bool = False
) -> Refined:
    """Return the most likely calibration near `start`, from the observations of the session's fit views.

    With `target_warp` the target may bulge, if the data support it.
    """
    unknown = np.array([joint.reading_std is None for joint in session.joints], dtype=bool)

    def refit(problem: Problem, estimate: Estimate) -> Fit:
        return _settled(problem, estimate, session, unknown)

    found = selected(session, refit(*built(session, observations, start)), refit, target_warp)
    problem, weights, aside, descent = (
        found.fit.problem,
        found.fit.weights,
        found.fit.aside,
        found.fit.descent,
    )
    noise = noise_variance(problem, descent, weights)
    covariance = step_covariance(problem, descent, noise)
    return Refined(
        problem,
        weights,
        descent,
        covariance,
        float(np.sqrt(noise)),
        aside,
        found.imperfections,
        found.unused_warp,
    )


def _settled(problem: Problem, estimate: Estimate, session: Session, unknown: NDArray[np.bool_]) -> Fit:
    """Return the fit from an estimate when neither noise nor outliers change any more.

    `unknown` (m,) tells the joints whose readings' noise nobody said. Raises UnsolvableError for a joint that does not
    move the camera.
    """
    names = [joint.name for joint in session.joints]
    problem, estimate, weights, aside = _approached(*resting(problem, estimate))
    problem, estimate = as_the_views_follow(problem, estimate, weights, session.readings())
    for _ in range(MOST_PASSES):
        problem, estimate = resting(problem, estimate)
        descent = descend(problem, estimate, weights)
        _check_moved(names, problem, descent)
        estimate, known = descent.estimate, step_covariance(problem, descent, 1.0)
        problem, found, settled = seen_noise(problem, estimate, weights, known, unknown)
        weights, newly = judged(problem, found)
        if settled and newly == aside:
            break
        aside = newly
    return Fit(problem, weights, aside, descent)


def _check_moved(names: Sequence[str], problem: Problem, descent: Descent) -> None:
    """Raise UnsolvableError where the views would hardly tell if a joint stood still, all else being known.

    Other than that are views that are all set aside: they tell nothing at all.
    """
    for name, scale in zip(names, problem.layout.scales, strict=True):
        told = descent.equations.information[scale, scale]
        if told == 0:
            raise UnsolvableError(
                f"all views in which joint '{name}' moved contradict the others, and would have to be set aside: it "
                "may have slipped or been knocked; check its motor's current and acceleration, home it and run again"
            )
        if told < LEAST_MOTION**2:
            raise UnsolvableError(stood_still(name))


def _approached(problem: Problem, estimate: Estimate) -> tuple[Problem, Estimate, Weights, SetAside]:
    """Return a first estimate that no outlier spoils, and what is to be set aside from there on.

    At the closed form good views may look knocked: with the bad points left out, a fit to all views tells whether any
    is. If so, all count a little, from the start again, until the chain is about right. Far from it every misfit would
    pass for noise of readings: that is asked later.
    """
    unasked = np.zeros_like(problem.prior)
    problem, found, _ = seen_noise(problem, estimate, all_in(problem), unasked)
    weights, aside = judged(problem, found)
    if not aside.views:
        return problem, estimate, weights, aside
    plain = descend(problem, estimate, without_bad_points(problem, found)).estimate
    rescaled, found_there, _ = seen_noise(problem, plain, weights, unasked)
    weights, aside = judged(rescaled, found_there)
    if not aside.views:
        return rescaled, plain, weights, aside
    for _ in range(SOFT_PASSES):
        estimate = descend(problem, estimate, softened(problem, found)).estimate
        problem, found, _ = seen_noise(problem, estimate, weights, unasked)
    return problem, estimate, *judged(problem, found)
