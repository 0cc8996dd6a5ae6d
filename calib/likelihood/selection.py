"""Which imperfections the data support: fitted for good one after the other, and kept where the likelihood pays.

A correction of k coefficients is kept when it gains more in twice the log-likelihood than the extended BIC asks for:
k log n, and 2 log c for having been chosen among c. Likelihoods are compared with

    views as scattered as each fit sees them: an error that is explained is no longer noise;
    a view that does not belong costing as much as one that just does, so that setting it aside gains nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from calib.errors import UnsolvableError
from calib.likelihood.descent import count_measurements
from calib.likelihood.imperfections import (
    Circumstances,
    Imperfections,
    Slip,
    possible_slips,
    with_imperfections,
)
from calib.likelihood.measurements import PointViews
from calib.likelihood.outliers import RARE, STUDENT, Given
from calib.likelihood.problem import Estimate, Problem, Weights, all_in, evaluate
from calib.likelihood.promises import Candidate, Fit, promised, worths
from calib.session import Session

Array = NDArray[np.float64]
Refit = Callable[[Problem, Estimate], Fit]

MOST_TRIES = 3
MOST_ROUNDS = 12
MOST_MOVES = 4
LEAST_OF_A_SLIP = 49.0
"""What a slip must gain: seven standard deviations, since what scatters views in groups might pass for less."""
BELONGS = float(chi2.isf(RARE, 6))
"""The squared distance beyond which a view does not belong."""
WORTH_TELLING = 0.02
"""The part of the misfit that an unused warp of the target must explain to be told of."""
HINT = 4.0
"""What a coefficient must promise where views are scattered or set aside: that hides most of what it would gain."""


@dataclass(frozen=True, eq=False)
class Selected:
    """The fit with the imperfections that the data support, and the target's warp that they would support as well."""

    fit: Fit
    imperfections: Imperfections
    unused_warp: Candidate | None


def selected(session: Session, fit: Fit, refit: Refit, target_warp: bool) -> Selected:
    """Return the fit with the imperfections that the data support, the target's warp only where asked for.

    `refit` fits a problem from an estimate until nothing changes.
    """
    search = Search(
        Circumstances.of(session), refit, np.array([j.reading_std or 0.0 for j in session.joints])
    )
    has = Imperfections()
    for _ in range(MOST_ROUNDS):
        every = promised(fit, search.about, has)
        price = _price(fit, every)
        weakest = min(worths(fit, has), key=lambda kept: kept.gain - price(kept), default=None)
        if weakest is not None and weakest.gain <= price(weakest):
            less = search.back(fit, has, weakest.imperfections)
            if less is None:
                break
            fit, has = less, weakest.imperfections
            continue
        candidates = [c for c in every if target_warp or c.imperfections.warp == has.warp]
        tries = _promising(candidates, price, search.scattered(fit), has)
        found = (search.forward(fit, has, candidate, price(candidate)) for candidate in tries)
        better = next((one for one in found if one is not None), None)
        if better is None:
            break
        fit, has = search.placed(*better)
    worth_telling = WORTH_TELLING * count_measurements(fit.problem, fit.weights)
    bulges = [c for c in every if c.imperfections.warp != has.warp and c.gain > max(price(c), worth_telling)]
    best = max(bulges, key=lambda c: c.gain - price(c), default=None)
    return Selected(fit, has, None if target_warp else best)


@dataclass(frozen=True, eq=False)
class Search:
    """Steps from a fit to one with more or less corrected; `given` (m,) is the noise of readings that was said."""

    about: Circumstances
    refit: Refit
    given: Array

    def scattered(self, fit: Fit) -> bool:
        """Whether the fit takes for scatter, or has set aside, what a correction may explain."""
        loosened = fit.problem.looseness > 0 or bool((fit.problem.reading_std != self.given).any())
        return loosened or bool(fit.aside.views)

    def forward(
        self, fit: Fit, has: Imperfections, candidate: Candidate, price: float
    ) -> tuple[Fit, Imperfections] | None:
        """Return the fit with the candidate's corrections if they gain more than their price, and what it has.

        None where nothing is better than before.
        """
        wanted = candidate.imperfections
        trial = self._with(fit, has, wanted)
        if trial is None:
            return None
        worth = [kept.gain for kept in worths(trial, wanted) if kept.imperfections == has]
        # A fit that ended nowhere gains no number at all.
        if not min([gained(fit, trial), *worth]) > price:
            return None
        # It may be the way there that gained: then it is open without the correction, too.
        plain = self.back(trial, wanted, has)
        if plain is None:
            return None
        return (trial, wanted) if gained(plain, trial) > price else (plain, has)

    def placed(self, fit: Fit, has: Imperfections) -> tuple[Fit, Imperfections]:
        """Return the fit with its last slip, if that is what came last, at the likeliest view near the one it `has`."""
        for _ in range(MOST_MOVES):
            last = has.models[-1] if has.models else None
            if not isinstance(last, Slip):
                break
            others = has.models[:-1]
            views = [s.view for s in possible_slips(fit.problem, others) if s.joint == last.joint]
            place = views.index(last.view)
            for view in views[max(place - 1, 0) : place] + views[place + 1 : place + 2]:
                wanted = replace(has, models=(*others, replace(last, view=view)))
                trial = self._with(fit, has, wanted)
                if trial is not None and gained(fit, trial) > 0:
                    fit, has = trial, wanted
                    break
            else:
                break
        return fit, has

    def _with(self, fit: Fit, has: Imperfections, wanted: Imperfections) -> Fit | None:
        """Return the fit with what is `wanted`, from where it is with nothing taken for scatter that was not said."""
        problem, estimate = with_imperfections(fit.problem, fit.descent.estimate, self.about, has, wanted)
        return self._fitted(replace(problem, reading_std=self.given, looseness=0.0), _as_read(estimate))

    def back(self, fit: Fit, has: Imperfections, wanted: Imperfections) -> Fit | None:
        """Return the fit with less than it `has`, from where it is; None where there is none."""
        return self._fitted(*with_imperfections(fit.problem, fit.descent.estimate, self.about, has, wanted))

    def _fitted(self, problem: Problem, estimate: Estimate) -> Fit | None:
        """Return the fit; None where it leads nowhere: the one before stands."""
        try:
            return self.refit(problem, estimate)
        except (UnsolvableError, np.linalg.LinAlgError):
            return None


def _price(fit: Fit, every: list[Candidate]) -> Callable[[Candidate], float]:
    """Return what a candidate must gain, as a function of it, having been chosen among `every` one of its sort."""
    measurements = count_measurements(fit.problem, fit.weights)
    slips = sum(candidate.slip is not None for candidate in every)

    def price(candidate: Candidate) -> float:
        sort, least = (len(every) - slips, 0.0) if candidate.slip is None else (slips, LEAST_OF_A_SLIP)
        return float(max(candidate.size * np.log(measurements) + 2 * np.log(max(sort, 1)), least))

    return price


def _promising(
    candidates: list[Candidate], price: Callable[[Candidate], float], scattered: bool, has: Imperfections
) -> list[Candidate]:
    """Return the candidates that promise enough to be fitted, where views count as `scattered` or not.

    Of several errors, each that remains is scatter enough to hide the others: then they are tried together, too.
    """
    # Of so many slips, one always promises a little of whatever scatters the views.
    hints = [HINT * c.size if c.slip is None else 2 * HINT for c in candidates]
    enough = [
        c for c, hint in zip(candidates, hints, strict=True) if c.gain > (hint if scattered else price(c) / 2)
    ]
    best = _one_slip_a_joint(sorted(enough, key=lambda c: price(c) - c.gain))[:MOST_TRIES]
    joints = [c for c in best if len(c.imperfections.models) > len(has.models)]
    if not scattered or len(joints) < 2:
        return best
    models = tuple(c.imperfections.models[-1] for c in joints)
    together = replace(has, models=(*has.models, *models))
    return [*best, Candidate(together, sum(c.size for c in joints), sum(c.gain for c in joints))]


def _one_slip_a_joint(candidates: list[Candidate]) -> list[Candidate]:
    """Return the candidates without slips that come after another one of the same joint: that is the likelier view."""
    joints = [None if c.slip is None else c.slip.joint for c in candidates]
    return [c for i, c in enumerate(candidates) if c.slip is None or joints[i] not in joints[:i]]


def _as_read(estimate: Estimate) -> Estimate:
    """Return the estimate with readings taken as they were read."""
    return replace(estimate, reading_errors=np.zeros_like(estimate.reading_errors))


def gained(before: Fit, after: Fit) -> float:
    """Return what `after` gains over `before` in twice the log-likelihood."""
    # Both in the same units of noise: those of before, which count no more than they should.
    groups = before.problem.groups
    weights = _without_bad_points(after)
    old = _deviance(before.problem, before, weights)
    return old - _deviance(replace(after.problem, groups=groups), after, weights)


def _without_bad_points(fit: Fit) -> Weights:
    """Return weights with which all views count, without the points that the fit set aside."""
    bad = set(fit.aside.points)
    groups = []
    for group, weight in zip(fit.problem.groups, all_in(fit.problem).groups, strict=True):
        if isinstance(group.data, PointViews) and bad:
            pairs = zip(np.repeat(group.data.views, weight.shape[1]), group.data.ids.ravel(), strict=True)
            wrong = np.array([(int(view), int(point)) in bad for view, point in pairs]).reshape(weight.shape)
            groups.append(np.where(wrong, 0.0, weight))
        else:
            groups.append(weight)
    return Weights(tuple(groups))


def _deviance(problem: Problem, fit: Fit, weights: Weights) -> float:
    """Return minus twice the log-likelihood, what scatters the views integrated out."""
    estimate = fit.descent.estimate
    there = evaluate(problem, _as_read(estimate), weights)
    total = float(estimate.travel @ problem.prior @ estimate.travel)
    for group, terms in zip(problem.groups, there.terms, strict=True):
        points = isinstance(group.data, PointViews)
        loose = 1 + problem.looseness if points else 1.0
        hessian, gradient = terms.blocks.hessian[:, :6, :6] / loose, terms.blocks.gradient[:, :6] / loose
        # A view whose points were all set aside says nothing, and its zeros cannot be divided by.
        hessian = hessian + (1e-13 * (np.trace(hessian, axis1=1, axis2=2) + 1))[:, None, None] * np.eye(6)
        away = (gradient * np.linalg.solve(hessian, gradient[..., None])[..., 0]).sum(axis=1)
        spread = terms.chain.by_reading * problem.reading_std
        transposed = np.swapaxes(spread, 1, 2)
        noise = transposed @ hessian @ spread + np.eye(spread.shape[2])
        if points:
            pull = (transposed @ gradient[..., None])[..., 0]
            distance = away - (pull * np.linalg.solve(noise, pull[..., None])[..., 0]).sum(axis=1)
            cost = terms.blocks.cost - loose * away + np.minimum(distance, BELONGS) + 6 * np.log(loose)
        else:
            parts = Given.of(terms.blocks).distance(spread @ transposed)
            cost = ((STUDENT + 3) * np.log1p(parts / STUDENT)).sum(axis=1)
        total += float((cost + np.linalg.slogdet(noise)[1]).sum())
    return total
