"""Idle joints: whether they stand still while another one is swept, or really move as their readings jitter.

An encoder's jitter is noise: the joint is at rest, where the mean of its readings says. A drive that does not hold
still moves the camera, and then each view's own readings are right. The views tell which.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.closed_form import PoseViews
from calib.likelihood.problem import Evaluation, Problem, said
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


def as_the_views_follow(problem: Problem, there: Evaluation, as_read: Array) -> Problem:
    """Return the problem with the readings `as_read` (n, m) of those joints whose jitter the views follow.

    `there` is the likelihood with all joints at rest. A step along the jitter gains there exactly where more than
    half of it is in the views.
    """
    jitter = as_read - problem.readings
    if not jitter.any():
        return problem
    slope, bend = np.zeros(jitter.shape[1]), np.zeros(jitter.shape[1])
    for group, terms in zip(problem.groups, there.terms, strict=True):
        views = group.data.views
        hessian, gradient, _ = said(problem, group, terms.blocks)
        moved = terms.chain.by_reading * (jitter / problem.noisiness)[views][:, None, :]
        slope += np.einsum("nkm,nk->m", moved, gradient[:, :6])
        bend += np.einsum("nkm,nkl,nlm->m", moved, hessian[:, :6, :6], moved)
    follows = 2 * slope + bend < 0
    return replace(
        problem,
        readings=np.where(follows, as_read, problem.readings),
        noisiness=np.where(follows, 1.0, problem.noisiness),
    )
