"""The whole fit: from the closed form to the most likely calibration, outliers set aside, noise found where unknown."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.chain import Chain
from calib.closed_form import PoseViews
from calib.likelihood.descent import Descent, descend
from calib.likelihood.held_out import HeldOut, held_out
from calib.likelihood.lens_terms import lens_from_vector, lens_vector
from calib.likelihood.measurements import GivenPoses, PointViews, point_views
from calib.likelihood.outliers import (
    Misfits,
    SetAside,
    judged,
    misfits,
    point_noise,
    softened,
    without_bad_points,
)
from calib.likelihood.problem import (
    Estimate,
    Evaluation,
    Group,
    Problem,
    Weights,
    all_in,
    evaluate,
    offsets_at,
)
from calib.likelihood.reading_noise import PoseMisfit, estimated_reading_std
from calib.likelihood.state import Layout, State
from calib.likelihood.uncertainty import noise_variance, step_covariance
from calib.observations import Observation
from calib.session import Intrinsics, Session
from calib.sweeps import readings_at_rest, sweep_labels
from calib.targets import disk_diameter, target_points

Array = NDArray[np.float64]

MOST_PASSES = 12
SOFT_PASSES = 5
LEAST_POSE_NOISE = 1e-9
"""In rad and m: given poses may be exact to rounding."""
SETTLED = 0.02
"""Relative change of a standard deviation that no longer matters."""


@dataclass(frozen=True, eq=False)
class Start:
    """Where the fit begins: the chain, each camera's pose at readings 0 (c, 4, 4), and its lens.

    `prior` (k, k) is what is known of the first k parameters, those of the joints and of the first camera's mount.
    """

    chain: Chain
    mounts: Array
    lenses: Sequence[Intrinsics | None]
    prior: Array | None = None


@dataclass(frozen=True, eq=False)
class Refined:
    """The most likely calibration.

    `covariance` (p, p) is of a step of `problem.layout`'s parameters, `noise` the standard deviation of one
    measurement in units of what it was taken for, `held_out` how well each view is predicted by the others.
    """

    problem: Problem
    weights: Weights
    descent: Descent
    covariance: Array
    noise: float
    set_aside: SetAside
    held_out: list[HeldOut]

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


def refine(session: Session, observations: Sequence[Observation], start: Start) -> Refined:
    """Return the most likely calibration near `start`, from the observations of the session's fit views."""
    problem, estimate = _problem(session, observations, start)
    unknown = np.array([joint.reading_std is None for joint in session.joints], dtype=bool)
    problem, estimate, weights, aside = _approached(problem, estimate)
    for _ in range(MOST_PASSES):
        descent = descend(problem, estimate, weights)
        estimate = descent.estimate
        problem, found, settled = _noise(problem, estimate, weights, unknown)
        weights, newly = judged(problem, found)
        if settled and newly == aside:
            break
        aside = newly
    noise = noise_variance(problem, descent, weights)
    covariance = step_covariance(problem, descent, noise)
    as_read = replace(estimate, reading_errors=np.zeros_like(estimate.reading_errors))
    predicted = held_out(
        problem,
        estimate,
        weights,
        descent.evaluation,
        evaluate(problem, as_read, weights, offsets_at(problem, as_read)),
        descent.equations.information,
    )
    return Refined(problem, weights, descent, covariance, float(np.sqrt(noise)), aside, predicted)


def _problem(session: Session, observations: Sequence[Observation], start: Start) -> tuple[Problem, Estimate]:
    lenses = tuple(None if lens is None else lens_vector(lens) for lens in start.lenses)
    state = State(start.chain, start.mounts, lenses, np.zeros(0), np.zeros(0))
    models = [None if lens is None else lens.model for lens in start.lenses]
    joints, cameras = [joint.name for joint in session.joints], [camera.name for camera in session.cameras]
    layout = Layout.of(state, joints, cameras, models)
    free = np.ones(len(layout), dtype=bool)
    for camera, part in zip(session.cameras, layout.lenses, strict=True):
        free[part] = camera.intrinsics is None
    points = target_points(session.target)
    groups: list[Group] = []
    for index in range(len(cameras)):
        own = [observation for observation in observations if observation.camera == index]
        link, lens = session.camera_link(index), start.lenses[index]
        seen = [observation for observation in own if observation.pose is None]
        if seen:
            groups.append(Group(index, link, lens, point_views(seen, points)))
        given = [observation for observation in own if observation.pose is not None]
        if given:
            views = np.array([observation.view for observation in given], dtype=np.intp)
            poses = np.array([observation.pose for observation in given])
            groups.append(Group(index, link, None, GivenPoses(views, poses, np.eye(6))))
    readings, noisiness = _readings_and_noisiness(session)
    problem = Problem(
        layout=layout,
        groups=tuple(groups),
        readings=readings,
        regressors=np.zeros((*readings.shape, 0)),
        noisiness=noisiness,
        reading_std=np.array([joint.reading_std or 0.0 for joint in session.joints]),
        free=free,
        prior=_padded(start.prior, len(layout)),
        disk_diameter=disk_diameter(session.target),
        bulges=np.zeros((len(points), 0)),
    )
    return problem, Estimate(state, np.zeros_like(readings), np.zeros(len(layout)))


def _padded(prior: Array | None, count: int) -> Array:
    """Return the prior (p, p), nothing being known of the parameters that it does not reach."""
    information = np.zeros((count, count))
    if prior is not None:
        information[: len(prior), : len(prior)] = prior
    return information


def _readings_and_noisiness(session: Session) -> tuple[Array, Array]:
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


def _approached(problem: Problem, estimate: Estimate) -> tuple[Problem, Estimate, Weights, SetAside]:
    """Return a first estimate that no outlier spoils, and what is to be set aside from there on.

    At the closed form good views may look knocked: with the bad points left out, a fit to all views tells whether any
    is. If so, all count a little, from the start again, until the chain is about right. Far from it every misfit would
    pass for noise of readings: that is asked later.
    """
    none = np.zeros(len(problem.reading_std), dtype=bool)
    problem, found, _ = _noise(problem, estimate, all_in(problem), none)
    weights, aside = judged(problem, found)
    if not aside.views:
        return problem, estimate, weights, aside
    plain = descend(problem, estimate, without_bad_points(problem, found)).estimate
    rescaled, found_there, _ = _noise(problem, plain, weights, none)
    weights, aside = judged(rescaled, found_there)
    if not aside.views:
        return rescaled, plain, weights, aside
    for _ in range(SOFT_PASSES):
        estimate = descend(problem, estimate, softened(problem, found)).estimate
        problem, found, _ = _noise(problem, estimate, weights, none)
    return problem, estimate, *judged(problem, found)


def _noise(
    problem: Problem, estimate: Estimate, weights: Weights, unknown: NDArray[np.bool_]
) -> tuple[Problem, Misfits, bool]:
    """Return the problem with each noise as large as it is seen to be, the misfits, and whether that was so before."""
    as_read = replace(estimate, reading_errors=np.zeros_like(estimate.reading_errors))
    there = evaluate(problem, estimate, all_in(problem), offsets_at(problem, estimate))
    scaled = _with_measurement_noise(problem, there, weights)
    offsets = offsets_at(scaled, as_read)
    if unknown.any():
        std = _reading_std(scaled, evaluate(scaled, as_read, weights, offsets), weights, unknown)
        scaled = replace(scaled, reading_std=std)
    found = misfits(scaled, evaluate(scaled, as_read, all_in(scaled), offsets))
    return scaled, found, _much_the_same(problem, scaled)


def _with_measurement_noise(problem: Problem, everything: Evaluation, weights: Weights) -> Problem:
    """Return the problem with whitenings under which misfits have unit variance."""
    spent = int(problem.free.sum())
    groups = []
    for group, terms, weight in zip(problem.groups, everything.terms, weights.groups, strict=True):
        if isinstance(group.data, PointViews):
            scale = point_noise(terms.blocks, group.data.present)
            data: PointViews | GivenPoses = replace(group.data, whitening=group.data.whitening / scale)
        else:
            residuals = terms.blocks.residuals[..., 0] @ np.linalg.inv(group.data.whitening).T
            data = replace(group.data, whitening=_whitening(np.asarray(residuals, float), weight, spent))
        groups.append(replace(group, data=data))
    return replace(problem, groups=tuple(groups))


def _whitening(residuals: Array, weight: Array, spent: int) -> Array:
    """Return the matrix (6, 6) that whitens pose residuals (n, 6), of which `spent` numbers were fitted away.

    Rotations and positions have a size each: more cannot be told from a few dozen poses without being misled.
    """
    freedom = max(int((weight > 0).sum()) - spent / 6, 1.0)
    variance = (weight[:, None] * residuals**2).sum(axis=0) / freedom
    sizes = np.repeat(variance.reshape(2, 3).mean(axis=1), 3)
    return np.diag(1 / np.sqrt(sizes + LEAST_POSE_NOISE**2))


def _reading_std(problem: Problem, there: Evaluation, weights: Weights, unknown: NDArray[np.bool_]) -> Array:
    """Return the standard deviation of each joint's readings (m,), estimated where it is unknown.

    `there` is where the readings are taken as they were read.
    """
    misfits = []
    for terms, weight in zip(there.terms, weights.groups, strict=True):
        kept = weight.reshape(len(weight), -1).any(axis=1)
        blocks = terms.blocks
        misfits.append(
            PoseMisfit(blocks.hessian[kept, :6, :6], blocks.gradient[kept, :6], terms.chain.by_reading[kept])
        )
    return estimated_reading_std(misfits, problem.reading_std, unknown)


def _much_the_same(before: Problem, after: Problem) -> bool:
    """Whether the noise of two problems differs by little."""
    return bool(
        np.allclose(before.reading_std, after.reading_std, rtol=SETTLED)
        and all(
            np.abs(old.data.whitening - new.data.whitening).max() < SETTLED * np.abs(new.data.whitening).max()
            for old, new in zip(before.groups, after.groups, strict=True)
        )
    )
