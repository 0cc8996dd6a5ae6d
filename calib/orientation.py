"""Which way round a symmetric target is seen, decided by the continuity of the readings.

A grid of disks looks the same upside down, so one picture cannot tell which corner is the world's origin.
Views at neighbouring readings were taken from neighbouring places, though: from the first view the choice
is carried on, each time to the view next nearest in readings, by the smaller turn of the camera. Afterwards
the solved chain itself checks every view.
"""

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from calib.chain import Chain
from calib.closed_form import PoseViews
from calib.errors import UnsolvableError
from calib.targets import TargetSymmetry
from calib.transforms import pose_error

Array = NDArray[np.float64]
Ints = NDArray[np.intp]
Solved = tuple[Chain, Array]

CHECKS = 3
"""How often the solved chain may change its mind about single views."""


def carried_on(views: PoseViews, symmetries: Sequence[TargetSymmetry], turnable: NDArray[np.bool_]) -> Array:
    """Return the poses (n, 4, 4), those of each camera read the way round of its first view.

    Views that are not `turnable` (n,) stay as they are: another system gave their poses.
    """
    ways = _ways_round(views.poses, symmetries)
    chosen = np.zeros(len(views.poses), dtype=np.intp)
    for camera in range(len(views.links)):
        own = np.flatnonzero(views.cameras == camera)
        parents, children = own[_nearest_first(views.readings[own])].T
        # For each way round of the parent the child's nearest, and its own where it may not be turned.
        nearest = np.array([_nearest(way[parents], ways[:, children]) for way in ways])
        nearest[:, ~turnable[children]] = 0
        for step, (parent, child) in enumerate(zip(parents.tolist(), children.tolist(), strict=True)):
            chosen[child] = nearest[chosen[parent], step]
    return np.asarray(ways[chosen, np.arange(len(chosen))])


def agreed(
    views: PoseViews,
    symmetries: Sequence[TargetSymmetry],
    turnable: NDArray[np.bool_],
    solve: Callable[[Array], Solved],
) -> tuple[Array, Solved]:
    """Return the poses (n, 4, 4) read the way round that the chain solved from them agrees with, and it.

    `views` are already carried on camera by camera; the first camera's way round is kept, the others follow
    it.
    """
    poses, solved = _cameras_matched(views, symmetries, solve)
    for _ in range(CHECKS):
        ways = _ways_round(poses, symmetries)
        chosen = np.where(turnable, _nearest(predicted_poses(solved, views), ways), 0)
        if not chosen.any():
            break
        poses = ways[chosen, np.arange(len(chosen))]
        solved = solve(poses)
    return poses, solved


def predicted_poses(solved: Solved, views: PoseViews) -> Array:
    """Return the poses (n, 4, 4) that the chain and mounts predict for the views."""
    chain, mounts = solved
    poses = np.empty_like(views.poses)
    for camera, link in enumerate(views.links):
        own = views.cameras == camera
        poses[own] = chain.poses(views.readings[own], link, mounts[camera])
    return poses


def _cameras_matched(
    views: PoseViews, symmetries: Sequence[TargetSymmetry], solve: Callable[[Array], Solved]
) -> tuple[Array, Solved]:
    """Try every way round of the further cameras against the first one's, and keep the best."""
    turns = [np.eye(4), *(symmetry.turned_from_world for symmetry in symmetries)]
    best: tuple[float, Array, Solved] | None = None
    failure: UnsolvableError | None = None
    for chosen in product(turns, repeat=len(views.links) - 1):
        by_camera = np.array([np.eye(4), *chosen])
        poses = by_camera[views.cameras] @ views.poses
        try:
            solved = solve(poses)
        except UnsolvableError as error:
            failure = failure or error
            continue
        _, angles = pose_error(predicted_poses(solved, views), poses)
        miss = float(np.median(angles))
        if best is None or miss < best[0]:
            best = miss, poses, solved
    if best is None:
        assert failure is not None
        raise failure
    return best[1], best[2]


def _ways_round(poses: Array, symmetries: Sequence[TargetSymmetry]) -> Array:
    """Return the poses (n, 4, 4) read in every way round (k, n, 4, 4), first as they are."""
    return np.stack([poses, *(symmetry.turned_from_world @ poses for symmetry in symmetries)])


def _nearest(expected: Array, ways: Array) -> Ints:
    """Return which of the `ways` round (k, n, 4, 4) has its rotation nearest to the `expected` poses' (n,)."""
    # The trace of a turn grows as its angle shrinks.
    traces = (expected[:, :3, :3] * ways[:, :, :3, :3]).sum(axis=(2, 3))
    return np.asarray(np.argmax(traces, axis=0))


def _nearest_first(readings: Array) -> Ints:
    """Return edges (parent, child) (n - 1, 2) of the readings' minimum spanning tree, from the first on (Prim)."""
    span = np.ptp(readings, axis=0) if len(readings) else np.zeros(0)
    places = readings / np.where(span > 0, span, 1)
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
