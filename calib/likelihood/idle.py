"""Idle joints: whether they stand still while another one is swept, or really move as their readings jitter.

An encoder's jitter is noise: the joint is at rest, where the mean of its readings says. A drive that does not hold
still moves the camera, and then each view's own readings are right. The views tell which.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.closed_form import PoseViews
from calib.likelihood.descent import descend
from calib.likelihood.problem import Estimate, Problem, Weights
from calib.session import Session
from calib.sweeps import readings_at_rest, sweep_labels

Array = NDArray[np.float64]


def at_rest(session: Session) -> tuple[Array, Array]:
    """Return all views' readings (n, m), idle joints' averaged over their sweep, and how much noise each still has."""
    every = PoseViews.of(session, range(len(session.views)), np.zeros((len(session.views), 4, 4)))
    labels = sweep_labels(every.readings, every.exercised, every.cameras, every.links)
    noisiness = np.ones_like(every.readings)
    for joint in range(labels.shape[1]):
        for sweep in np.unique(labels[labels[:, joint] >= 0, joint]):
            members = labels[:, joint] == sweep
            noisiness[members] = 1 / np.sqrt(members.sum())
            noisiness[members, joint] = 1
    return readings_at_rest(every.readings, labels), noisiness


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
        readings, noisiness = problem.readings.copy(), problem.noisiness.copy()
        readings[:, joint], noisiness[:, joint] = as_read[:, joint], 1.0
        moving = replace(problem, readings=readings, noisiness=noisiness)
        tried = descend(moving, best.estimate, weights)
        if tried.evaluation.cost < best.evaluation.cost:
            problem, best = moving, tried
    return problem, best.estimate
