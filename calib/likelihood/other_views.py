"""Views that could be taken as well, or instead, and what they would tell by the model's own terms, with no picture."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.lens import project_points
from calib.likelihood.lens_terms import lens_from_vector
from calib.likelihood.measurements import GivenPoses, PointViews
from calib.likelihood.normal import normal_equations
from calib.likelihood.problem import Estimate, Group, Problem, Weights, evaluate
from calib.likelihood.state import State
from calib.session import Session
from calib.targets import AprilGrid, Charuco, target_points
from calib.transforms import inverse, transform
from calib.twists import exp_twist

Array = NDArray[np.float64]

TILT = 30.0
"""In degrees."""
STEEPEST = 60.0
"""How far (deg) a target may lean against the line of sight and still be found."""
ENOUGH = 0.8
"""Share of the views that must see the target for a change to be offered."""


@dataclass(frozen=True)
class Sweep:
    """A joint swept from `low` to `high` as well, another one standing at a reading of its own if `beside` is given."""

    joint: str
    low: float
    high: float
    beside: tuple[str, float] | None = None


@dataclass(frozen=True)
class Tilt:
    """The plate turned about one of its own axes by so many degrees, and everything taken again."""

    axis: str
    degrees: float


@dataclass(frozen=True)
class Nearer:
    """The plate moved nearer by a third, and everything taken again."""


@dataclass(frozen=True)
class Twice:
    """Every view taken twice."""


Change = Sweep | Tilt | Nearer | Twice


@dataclass(frozen=True, eq=False)
class OtherViews:
    """Views like those at the places `views` (k,) in the session, but at `readings` (k, m).

    They are taken as well or, where the target is moved by `plate` (4, 4) in the world, instead of the present ones.
    """

    change: Change
    views: NDArray[np.intp]
    readings: Array
    plate: Array | None = None


def other_views(session: Session, problem: Problem, state: State) -> Iterator[OtherViews]:
    """Give the changes of the plan that are worth asking about."""
    every = np.concatenate([group.data.views for group in problem.groups])
    readings = problem.readings
    exercised = np.array([session.views[view].joint for view in every], dtype=object)
    names = [joint.name for joint in session.joints]
    for joint, name in enumerate(names):
        alone = every[exercised == name]
        own = alone if len(alone) else every
        low, high = readings[own, joint].min(), readings[own, joint].max()
        half = (high - low) / 2
        for first, last in ((low - half, high + half), (low - half, high), (low, high + half)):
            wider = readings[own].copy()
            wider[:, joint] = first + (wider[:, joint] - low) * (last - first) / max(high - low, 1e-12)
            yield OtherViews(Sweep(name, float(first), float(last)), own, wider)
        for beside, neighbour in enumerate(names):
            if beside == joint or not len(alone):
                continue
            for end in (readings[every, beside].min(), readings[every, beside].max()):
                elsewhere = readings[own].copy()
                elsewhere[:, beside] = end
                sweep = Sweep(name, float(low), float(high), (neighbour, float(end)))
                yield OtherViews(sweep, own, elsewhere)
    yield OtherViews(Twice(), every, readings[every])
    points = target_points(session.target)
    if len(points):
        for change, plate in _placements(problem, state, points.mean(axis=0)):
            yield OtherViews(change, every, readings[every], plate)


def _placements(problem: Problem, state: State, centre: Array) -> Iterator[tuple[Change, Array]]:
    """Give other places of the plate, as motions (4, 4) of its points in the world; `centre` (3,) is its middle."""
    there, back = transform(np.eye(3), centre), transform(np.eye(3), -centre)
    for axis, direction in (("X", 0), ("Y", 1)):
        for degrees in (TILT, -TILT):
            turn = np.zeros(6)
            turn[direction] = np.radians(degrees)
            yield Tilt(axis, degrees), there @ exp_twist(turn) @ back
    group = problem.groups[0]
    seen = problem.readings[group.data.views]
    poses = state.chain.poses(seen, group.link, state.mounts[group.camera])
    yield Nearer(), transform(np.eye(3), (poses[:, :3, 3].mean(axis=0) - centre) / 3)


def information_of(
    others: OtherViews, session: Session, problem: Problem, estimate: Estimate
) -> Array | None:
    """Return what the other views would tell of the parameters (p, p); None where too few of them see the target."""
    groups: list[Group] = []
    weights: list[Array] = []
    offsets: list[Array | None] = []
    count, usable = 0, 0
    for group in problem.groups:
        own = np.flatnonzero(np.isin(others.views, group.data.views))
        poses = estimate.state.chain.poses(
            others.readings[own], group.link, estimate.state.mounts[group.camera]
        )
        count += len(own)
        if isinstance(group.data, GivenPoses):
            usable += len(own)
            groups.append(replace(group, data=replace(group.data, views=own, poses=poses)))
            weights.append(np.ones((len(own), 6)))
            offsets.append(None)
            continue
        points = target_points(session.target)
        plate = np.eye(4) if others.plate is None else others.plate
        world = points @ plate[:3, :3].T + plate[:3, 3]
        seen = _seen(session, group, estimate.state, world, -plate[:3, 2], poses)
        usable += int(seen.any(axis=1).sum())
        data = _imagined(group.data, own, world)
        groups.append(replace(group, data=data))
        weights.append(seen.astype(float))
        offsets.append(np.zeros_like(data.pixels))
    if usable < ENOUGH * count:
        return None
    imagined = replace(
        problem,
        groups=tuple(groups),
        readings=others.readings,
        noisiness=problem.noisiness[others.views],
        regressors=problem.regressors[others.views],
        at_rest=problem.at_rest[others.views],
        prior=np.zeros_like(problem.prior),
    )
    still = replace(estimate, reading_errors=np.zeros_like(others.readings), offsets=tuple(offsets))
    evaluation = evaluate(imagined, still, Weights(tuple(weights)))
    return normal_equations(imagined, still, evaluation).information


def _imagined(like: PointViews, views: NDArray[np.intp], world: Array) -> PointViews:
    """Return views of all the target's points at `world` (t, 3), each known as well as one is on the mean."""
    precision = np.swapaxes(like.whitening, -1, -2) @ like.whitening
    mean = np.average(precision, axis=(0, 1), weights=like.present)
    shape = (len(views), len(world))
    return PointViews(
        views=views,
        ids=np.broadcast_to(np.arange(len(world)), shape),
        world=np.broadcast_to(world, (*shape, 3)),
        pixels=np.zeros((*shape, 2)),
        whitening=np.broadcast_to(np.linalg.cholesky(mean).T, (*shape, 2, 2)),
        present=np.ones(shape),
        disk=np.zeros(len(views), dtype=bool),
    )


def _seen(
    session: Session, group: Group, state: State, world: Array, normal: Array, poses: Array
) -> NDArray[np.bool_]:
    """Return which points (n, t) cameras at `poses` (n, 4, 4) see, none of a view in which the target is not found.

    `world` (t, 3) are the points, `normal` (3,) is the printed side's.
    """
    values = state.lenses[group.camera]
    assert isinstance(group.data, PointViews)
    assert group.lens is not None
    assert values is not None
    camera_from_world = inverse(poses)[:, None]
    local = (camera_from_world[..., :3, :3] @ world[..., None])[..., 0] + camera_from_world[..., :3, 3]
    pixels = project_points(local, lens_from_vector(values, group.lens))
    camera = session.cameras[group.camera]
    width = camera.width or group.lens.width or group.data.pixels[..., 0].max() + 1
    height = camera.height or group.lens.height or group.data.pixels[..., 1].max() + 1
    # Comparisons with NaN, which is behind the camera, are false.
    inside = ((pixels >= 0) & (pixels <= np.array([width, height]) - 1)).all(axis=-1)
    sight = poses[:, :3, 3] - world.mean(axis=0)
    facing = sight @ normal >= np.cos(np.radians(STEEPEST)) * np.linalg.norm(sight, axis=1)
    # Targets whose points are numbered are found by a part of them.
    needed = 0.5 if isinstance(session.target, AprilGrid | Charuco) else 1.0
    found = facing & (inside.mean(axis=1) >= needed)
    return np.asarray(inside & found[:, None])
