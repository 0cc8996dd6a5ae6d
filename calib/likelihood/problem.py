"""The likelihood: which measurements there are, what is free, and what is known beforehand."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.likelihood.blocks import Blocks, disk_offsets, loosened, point_blocks, pose_blocks
from calib.likelihood.chain_terms import ChainTerms, chain_terms
from calib.likelihood.lens_terms import lens_from_vector
from calib.likelihood.measurements import GivenPoses, PointViews
from calib.likelihood.state import Layout, State
from calib.session import Intrinsics

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Group:
    """Views of one camera that carry one kind of measurement; `link` joints move it, `lens` names its model."""

    camera: int
    link: int
    lens: Intrinsics | None
    data: PointViews | GivenPoses


@dataclass(frozen=True, eq=False)
class Rest:
    """A joint that stands still in some `views` (k,): what its readings are off by there, it is off by in all.

    `share` is how much of a reading's noise that is: less than 1 where many readings of it were averaged.
    """

    joint: int
    views: NDArray[np.intp]
    share: float


@dataclass(frozen=True, eq=False)
class Problem:
    """A session as a likelihood.

    `readings` (n, m) are those of all the session's views, `regressors` (n, m, k) say how much of each correction
    is added to them, `rests` are where joints stand still, `at_rest` (n, m, r) what the state's add to the
    readings, `reading_std` (m,) how noisy they are, and `noisiness` (n, m) how much of that noise each
    has: the mean of an idle joint's readings over a sweep has less. `looseness` says how many times the covariance
    that its points give a view's pose its distance from the chain has beyond that. `free` (p,) are the parameters that
    may move, `prior` (p, p) the information that says how far from the start. `bulges` (t, w) are the shapes of the
    target's warp at its points, `sensors` (a,) the cameras whose given poses may have an aspect.
    """

    layout: Layout
    groups: tuple[Group, ...]
    readings: Array
    regressors: Array
    rests: tuple[Rest, ...]
    at_rest: Array
    reading_std: Array
    noisiness: Array
    looseness: float
    free: NDArray[np.bool_]
    prior: Array
    disk_diameter: float | None
    bulges: Array
    sensors: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Estimate:
    """A state, and how far each view's true readings are from what was read (n, m), over their noisiness.

    `travel` (p,) adds up the steps since the start. `offsets` are what each group's centroids of disks are off by
    (n, q, 2) in px, None for given poses: they hardly depend on the estimate, and are renewed now and then.
    """

    state: State
    reading_errors: Array
    travel: Array
    offsets: tuple[Array | None, ...]


@dataclass(frozen=True, eq=False)
class Weights:
    """The weight of each measurement of a group: points (n, q) or poses (n, 6), 0 for what is set aside."""

    groups: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class GroupTerms:
    """A group's blocks by the local vector, its views' chain terms, and which readings these were."""

    chain: ChainTerms
    blocks: Blocks


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The likelihood at an estimate: `cost` is minus twice its logarithm, up to a constant."""

    terms: tuple[GroupTerms, ...]
    cost: float


def all_in(problem: Problem) -> Weights:
    """Return weights with which everything counts."""
    return Weights(
        tuple(
            group.data.present if isinstance(group.data, PointViews) else np.ones((len(group.data.views), 6))
            for group in problem.groups
        )
    )


def offsets_at(problem: Problem, estimate: Estimate) -> tuple[Array | None, ...]:
    """Return for each group what its centroids of disks are off by, at this estimate."""
    offsets: list[Array | None] = []
    for group in problem.groups:
        if not isinstance(group.data, PointViews):
            offsets.append(None)
        elif problem.disk_diameter is None or not group.data.disk.any():
            offsets.append(np.zeros_like(group.data.pixels))
        else:
            poses, lens = _chain_terms(problem, group, estimate).poses, lens_of(group, estimate.state)
            offsets.append(disk_offsets(group.data, poses, lens, problem.disk_diameter))
    return tuple(offsets)


def lens_of(group: Group, state: State) -> Intrinsics:
    """Return the group's lens at `state`."""
    values = state.lenses[group.camera]
    assert group.lens is not None
    assert values is not None
    return lens_from_vector(values, group.lens)


def evaluate(problem: Problem, estimate: Estimate, weights: Weights) -> Evaluation:
    """Return the likelihood and its terms at `estimate`."""
    state = estimate.state
    terms, cost = [], 0.0
    for group, weight, offset in zip(problem.groups, weights.groups, estimate.offsets, strict=True):
        chain = _chain_terms(problem, group, estimate)
        if isinstance(group.data, PointViews):
            lens = state.lenses[group.camera]
            assert group.lens is not None
            assert lens is not None
            assert offset is not None
            bulges = problem.bulges[group.data.ids]
            blocks = point_blocks(
                group.data, chain.poses, lens, group.lens.model, offset, weight, bulges @ state.warp, bulges
            )
        else:
            own = np.array([float(camera == group.camera) for camera in problem.sensors])
            blocks = pose_blocks(group.data, chain.poses, weight, own, state.aspects)
        terms.append(GroupTerms(chain, blocks))
        cost += float(said(problem, group, blocks)[2].sum())
    noisy = problem.reading_std > 0
    cost += float(((estimate.reading_errors[:, noisy] / problem.reading_std[noisy]) ** 2).sum())
    cost += float(estimate.travel @ problem.prior @ estimate.travel)
    return Evaluation(tuple(terms), cost if np.isfinite(cost) else np.inf)


def said(problem: Problem, group: Group, blocks: Blocks) -> tuple[Array, Array, Array]:
    """Return hessian, gradient and cost of the group's views, as loosely as points tell of the chain.

    Given poses have in their own noise whatever scatters them.
    """
    return loosened(blocks, problem.looseness if isinstance(group.data, PointViews) else 0.0)


def _chain_terms(problem: Problem, group: Group, estimate: Estimate) -> ChainTerms:
    views = group.data.views
    noisiness = problem.noisiness[views]
    readings = problem.readings[views] + noisiness * estimate.reading_errors[views]
    regressors = problem.regressors[views]
    if len(estimate.state.rests):
        regressors = np.concatenate([problem.at_rest[views], regressors], axis=2)
    terms = chain_terms(estimate.state, problem.layout, group.camera, group.link, readings, regressors)
    return replace(terms, by_reading=terms.by_reading * noisiness[:, None, :])
