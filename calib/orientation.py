"""Which way round a symmetric target is seen, decided by the readings, or said to be undecided.

A grid of disks looks the same upside down, so one picture cannot tell which corner is the world's origin.
Views at neighbouring readings were taken from neighbouring places, though: from the first view the choice
is carried on, each time to the view next nearest in readings, by the smaller turn of the camera. Where the camera
turned far, or the readings jumped, that is no proof, and a new group of views begins. Of all ways round of the groups,
that is right which one chain explains best. Where another one does nearly as well, nobody can know, and the views are
named. Afterwards the solved chain itself checks every view.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from calib.chain import Chain
from calib.closed_form import PoseViews
from calib.errors import UnsolvableError
from calib.targets import TargetSymmetry
from calib.transforms import pose_error, rotation_log

Array = NDArray[np.float64]
Ints = NDArray[np.intp]
Mask = NDArray[np.bool_]
Solved = tuple[Chain, Array]

PLAINLY_NEARER = 0.5
"""A way round is beyond doubt where it turns the camera by less than this part of what the next one does."""
A_JUMP = 3.0
"""But not after a step of a joint that is more than so many times as long as its steps mostly are."""
MOST_TRIALS = 64
"""If there are more ways round of all groups together, one group is turned at a time."""
NEARLY_AS_WELL = 3.0
"""Another way round is not excluded where the views miss the chain by less than so many times as much."""
LIKE_ITS_UNIT = 0.05
"""A scale that is this near, relative to it, to what the joint's unit says speaks for its way round."""
MOST_NAMED = 8
CHECKS = 3
"""How often the solved chain may change its mind about single views."""


@dataclass(frozen=True, eq=False)
class Oriented:
    """Poses (n, 4, 4) that are all read the same way round, what was solved from them, and who might be otherwise.

    `undecided` are the views, by their place in the poses, that fit nearly as well another way round.
    """

    poses: Array
    solved: Solved
    undecided: Ints


@dataclass(frozen=True, eq=False)
class _Trial:
    """Groups of views turned by the symmetries `chosen`, the chain solved so, and how far the views miss it."""

    chosen: tuple[int, ...]
    solved: Solved
    miss: float


def oriented(
    views: PoseViews,
    symmetries: Sequence[TargetSymmetry],
    turnable: Mask,
    solve: Callable[[PoseViews], Solved],
    units: Sequence[float | None],
) -> Oriented:
    """Read all views the same way round: that of the first one, or of those that are not `turnable` (n,).

    The latter stay as they are, since another system gave their poses. `solve` returns chain and mounts of views
    read in some way, and raises UnsolvableError; `units` are what a reading of each joint nominally is (rad, m).
    """
    carried, groups = _carried_on(views, symmetries, turnable)
    views = replace(views, poses=carried)
    telling = _telling(views, groups)
    turns = np.array([np.eye(4), *(symmetry.turned_from_world for symmetry in symmetries)])
    told = _part(views, telling)
    names, members = np.unique(groups[telling], return_inverse=True)
    fixed = np.isin(names, groups[telling & ~turnable])
    if not fixed.any():
        fixed[members[0]] = True
    trials = _trials(told, members, fixed, turns, solve)
    best = min(trials, key=lambda trial: trial.miss)
    rivals = [trial for trial in trials if trial.miss <= NEARLY_AS_WELL * best.miss]
    rivals = [trial for trial in rivals if _like_its_units(trial, units)] or rivals
    # Between equals, the turns that were carried on.
    kept = min(rivals, key=lambda trial: (np.count_nonzero(trial.chosen), trial.miss))
    differing = np.any([np.not_equal(trial.chosen, kept.chosen) for trial in rivals], axis=0)
    undecided = np.flatnonzero(telling)[differing[members]]
    poses = carried.copy()
    poses[telling] = turns[np.array(kept.chosen)[members]] @ carried[telling]
    checked = _checked(replace(views, poses=poses), symmetries, turnable, solve, kept.solved, telling)
    return Oriented(*checked, undecided)


def undecided_in_words(views: Sequence[int], kind: str) -> list[str]:
    """Return a sentence about `views`, by place, that fit nearly as well another way round of a target of `kind`."""
    if not views:
        return []
    named = ", ".join(str(view) for view in views[:MOST_NAMED])
    named = f"view {named}" if len(views) == 1 else f"views {named}"
    if len(views) > MOST_NAMED:
        named += f" and {len(views) - MOST_NAMED} more"
    return [
        f"which way round the {kind.replace('_', ' ')} is seen in {named} cannot be told: the readings allow another "
        "way as well; take views in between, at smaller turns of the camera, or use a target with markers"
    ]


def _carried_on(views: PoseViews, symmetries: Sequence[TargetSymmetry], turnable: Mask) -> tuple[Array, Ints]:
    """Return the poses (n, 4, 4), each read the way nearest to a neighbour's, and groups (n,) that are so beyond doubt.

    A camera's first view stays as it is.
    """
    ways = _ways_round(views.poses, symmetries)
    chosen = np.zeros(len(views.poses), dtype=np.intp)
    groups = np.arange(len(views.poses))
    for camera in range(len(views.links)):
        own = np.flatnonzero(views.cameras == camera)
        edges = _nearest_first(views.readings[own])
        parents, children = own[edges].T
        # For each way round of the parent, the child's way round and whether there is no doubt of it.
        turned = np.array([_angles(way[parents], ways[:, children]) for way in ways])
        nearest = np.where(turnable[children], turned.argmin(axis=1), 0)
        least, next_least = np.sort(turned, axis=1)[:, :2].swapaxes(0, 1)
        plain = (least < PLAINLY_NEARER * next_least) & (nearest == turned.argmin(axis=1))
        plain &= ~_jumps(views.readings[own], edges)
        for step, (parent, child) in enumerate(zip(parents.tolist(), children.tolist(), strict=True)):
            way = chosen[parent]
            chosen[child] = nearest[way, step]
            if plain[way, step]:
                groups[child] = groups[parent]
    return np.asarray(ways[chosen, np.arange(len(chosen))]), groups


def _telling(views: PoseViews, groups: Ints) -> Mask:
    """Return which views (n,) tell the chain: the groups in which a joint moves alone, if their camera has any."""
    swept = np.isin(groups, groups[views.exercised >= 0])
    return np.asarray(swept | ~np.isin(views.cameras, views.cameras[swept]))


def _trials(
    views: PoseViews, groups: Ints, fixed: Mask, turns: Array, solve: Callable[[PoseViews], Solved]
) -> list[_Trial]:
    """Solve the groups (n,) turned in all ways, but for those `fixed` (g,); or, of too many, one by one."""
    done: dict[tuple[int, ...], _Trial] = {}
    failure: UnsolvableError | None = None
    for chosen in _choices(fixed, len(turns), done):
        if chosen in done:
            continue
        turned = replace(views, poses=turns[np.array(chosen)[groups]] @ views.poses)
        try:
            solved = solve(turned)
        except UnsolvableError as error:
            failure = failure or error
            continue
        done[chosen] = _Trial(chosen, solved, _miss(solved, turned))
    if not done:
        assert failure is not None
        if fixed.all():
            raise failure
        raise UnsolvableError(
            f"{failure}; the target looks the same after every turn by {360 / len(turns):g} degrees, so that views "
            f"less than {180 / len(turns):g} degrees apart are best"
        ) from failure
    return list(done.values())


def _choices(fixed: Mask, ways: int, done: dict[tuple[int, ...], _Trial]) -> Iterator[tuple[int, ...]]:
    """Yield ways round of all groups; where they are too many, by what is `done` so far."""
    free = np.flatnonzero(~fixed).tolist()
    if ways ** len(free) <= MOST_TRIALS:
        yield from product(*[(0,) if held else range(ways) for held in fixed])
        return
    yield (0,) * len(fixed)
    for _ in range(CHECKS):
        for group in free:
            best = min(done.values(), key=lambda trial: trial.miss).chosen if done else (0,) * len(fixed)
            for way in range(ways):
                yield (*best[:group], way, *best[group + 1 :])


def _miss(solved: Solved, views: PoseViews) -> float:
    """Return how far (rms) the views' poses are from the chain's: angles (rad), and places by their distance."""
    predicted = predicted_poses(solved, views)
    distances, angles = pose_error(predicted, views.poses)
    reach = np.maximum(np.linalg.norm(views.poses[:, :3, 3], axis=1), 1e-9)
    return float(np.sqrt((angles**2 + (distances / reach) ** 2).mean()))


def _like_its_units(trial: _Trial, units: Sequence[float | None]) -> bool:
    """Return whether every scale is about what the joint's unit says."""
    scales = trial.solved[0].scales.tolist()
    return all(
        unit is None or abs(scale / unit - 1) < LIKE_ITS_UNIT
        for scale, unit in zip(scales, units, strict=True)
    )


def _checked(
    views: PoseViews,
    symmetries: Sequence[TargetSymmetry],
    turnable: Mask,
    solve: Callable[[PoseViews], Solved],
    solved: Solved,
    telling: Mask,
) -> tuple[Array, Solved]:
    """Return the poses (n, 4, 4) read the way round that the chain solved from them agrees with, and it.

    It was `solved` from those `telling` (n,).
    """
    of_all = bool(telling.all())
    for _ in range(CHECKS):
        ways = _ways_round(views.poses, symmetries)
        nearest = np.argmin(_angles(predicted_poses(solved, views), ways), axis=0)
        chosen = np.where(turnable, nearest, 0)
        if of_all and not chosen.any():
            break
        views = replace(views, poses=ways[chosen, np.arange(len(chosen))])
        solved, of_all = solve(views), True
    return views.poses, solved


def predicted_poses(solved: Solved, views: PoseViews) -> Array:
    """Return the poses (n, 4, 4) that the chain and mounts predict for the views."""
    chain, mounts = solved
    poses = np.empty_like(views.poses)
    for camera, link in enumerate(views.links):
        own = views.cameras == camera
        poses[own] = chain.poses(views.readings[own], link, mounts[camera])
    return poses


def _part(views: PoseViews, kept: Mask) -> PoseViews:
    return replace(
        views,
        poses=views.poses[kept],
        readings=views.readings[kept],
        exercised=views.exercised[kept],
        cameras=views.cameras[kept],
    )


def _ways_round(poses: Array, symmetries: Sequence[TargetSymmetry]) -> Array:
    """Return the poses (n, 4, 4) read in every way round (k, n, 4, 4), first as they are."""
    return np.stack([poses, *(symmetry.turned_from_world @ poses for symmetry in symmetries)])


def _angles(expected: Array, ways: Array) -> Array:
    """Return how far (rad) each of `ways` (k, ..., 4, 4) is turned from the `expected` poses (..., 4, 4): (k, ...)."""
    turns = ways[..., :3, :3] @ np.swapaxes(expected[..., :3, :3], -1, -2)
    vectors = rotation_log(turns.reshape(-1, 3, 3)).reshape(*turns.shape[:-2], 3)
    return np.asarray(np.linalg.norm(vectors, axis=-1))


def _nearest_first(readings: Array) -> Ints:
    """Return edges (parent, child) (n - 1, 2) of the readings' minimum spanning tree, from the first on (Prim)."""
    places = _places(readings)
    count = len(places)
    distance, parent = np.full(count, np.inf), np.zeros(count, dtype=int)
    outside = np.ones(count, dtype=bool)
    edges, newest = [], 0
    for _ in range(count - 1):
        outside[newest] = False
        step = np.linalg.norm(places - places[newest], axis=1)
        nearer = outside & (step < distance)
        distance[nearer], parent[nearer] = step[nearer], newest
        newest = int(np.argmin(np.where(outside, distance, np.inf)))
        edges.append((parent[newest], newest))
    return np.array(edges, dtype=np.intp).reshape(-1, 2)


def _jumps(readings: Array, edges: Ints) -> Mask:
    """Return along which edges (e, 2) a joint's step is long beside the median of those in which it moves most."""
    places = _places(readings)
    steps = np.abs(places[edges[:, 1]] - places[edges[:, 0]])
    moved_most = steps.argmax(axis=1) if steps.size else np.zeros(0, dtype=np.intp)
    jumps = np.zeros(len(steps), dtype=bool)
    for joint in np.unique(moved_most):
        jumps |= steps[:, joint] > A_JUMP * np.median(steps[moved_most == joint, joint])
    return jumps


def _places(readings: Array) -> Array:
    """Return the readings (n, m) as parts of their joints' ranges."""
    span = np.ptp(readings, axis=0) if len(readings) else np.ones(readings.shape[1])
    return np.asarray(readings / np.where(span > 0, span, 1))
