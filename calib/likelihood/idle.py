"""Idle joints: whether they stand still while another one is swept, or really move as their readings jitter.

An encoder's jitter is noise: the joint is at rest, near where the mean of its readings says, and as far from it in all
these views. A drive that does not hold still moves the camera, and then each view's own readings are right. The
views tell which.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.closed_form import PoseViews
from calib.likelihood.descent import descend
from calib.likelihood.problem import Estimate, Problem, Rest, Weights
from calib.session import Session
from calib.sweeps import readings_at_rest, sweep_labels

Array = NDArray[np.float64]


def at_rest(session: Session) -> tuple[Array, tuple[Rest, ...]]:
    """Return all views' readings (n, m), idle joints' averaged over their sweep, and where joints stand still."""
    every = PoseViews.of(session, range(len(session.views)), np.zeros((len(session.views), 4, 4)))
    labels = sweep_labels(every.readings, every.exercised, every.cameras, every.links)
    rests = []
    for joint in range(labels.shape[1]):
        for sweep in np.unique(labels[labels[:, joint] >= 0, joint]):
            views = np.flatnonzero(labels[:, joint] == sweep)
            for idle in np.delete(np.arange(labels.shape[1]), joint):
                # Readings that never differ are one reading, however often it was read.
                differ = np.ptp(every.readings[views, idle]) > 0
                rests.append(Rest(int(idle), views, 1 / np.sqrt(len(views)) if differ else 1.0))
    return readings_at_rest(every.readings, labels), tuple(rests)


def as_the_views_follow(
    problem: Problem, estimate: Estimate, weights: Weights, as_read: Array
) -> tuple[Problem, Estimate]:
    """Return the problem with the readings `as_read` (n, m) of those joints whose jitter the views follow, and its fit.

    Each joint is given the readings, at rest or not, with which the fit is the more likely.
    """
    jitters = np.flatnonzero((problem.readings != as_read).any(axis=0))
    if not len(jitters):
        return problem, estimate
    best = descend(problem, estimate, weights)
    for joint in jitters:
        readings = problem.readings.copy()
        readings[:, joint] = as_read[:, joint]
        rests = tuple(rest for rest in problem.rests if rest.joint != joint or rest.share == 1)
        moving = replace(problem, readings=readings, rests=rests)
        tried = descend(moving, best.estimate, weights)
        if tried.evaluation.cost < best.evaluation.cost:
            problem, best = moving, tried
    return problem, best.estimate


def resting(problem: Problem, estimate: Estimate) -> tuple[Problem, Estimate]:
    """Return the problem in which joints with noisy readings are off by one amount in each rest, and its estimate.

    These amounts are parameters, known beforehand to be as small as the noise.
    """
    active = [rest for rest in problem.rests if problem.reading_std[rest.joint] > 0]
    layout, before = problem.layout, len(estimate.state.rests)
    if not active and not before:
        return problem, estimate
    first, count, more = layout.rests.start, len(active), len(active) - before
    # What comes before and after the rests stays; they stay, too, where they are as many as before.
    kept = np.r_[:first, first + before : len(layout)]
    moved = np.r_[:first, first + count : len(layout) + more]
    information, free = np.zeros((len(layout) + more,) * 2), np.ones(len(layout) + more, dtype=bool)
    information[np.ix_(moved, moved)], free[moved] = problem.prior[np.ix_(kept, kept)], problem.free[kept]
    values = estimate.state.rests if more == 0 else np.zeros(count)
    travel = np.zeros(len(free))
    travel[moved], travel[first : first + count] = estimate.travel[kept], values
    regressors, noisiness = np.zeros((*problem.readings.shape, count)), np.ones_like(problem.readings)
    for index, rest in enumerate(active):
        information[first + index, first + index] = (rest.share * problem.reading_std[rest.joint]) ** -2.0
        regressors[rest.views, rest.joint, index] = 1
        noisiness[rest.views, rest.joint] = 0
    names = [f"rest.{index}" for index in range(count)]
    layout = replace(
        layout,
        names=(*layout.names[:first], *names, *layout.names[first + before :]),
        rests=slice(first, first + count),
        corrections=_shifted(layout.corrections, more),
        warp=_shifted(layout.warp, more),
        aspects=_shifted(layout.aspects, more),
    )
    problem = replace(
        problem, layout=layout, at_rest=regressors, noisiness=noisiness, prior=information, free=free
    )
    errors = np.where(noisiness > 0, estimate.reading_errors, 0.0)
    state = replace(estimate.state, rests=values)
    return problem, replace(estimate, state=state, travel=travel, reading_errors=errors)


def _shifted(part: slice, by: int) -> slice:
    return slice(part.start + by, part.stop + by)
