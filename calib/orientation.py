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
Solved = tuple[Chain, Array]

CHECKS = 3
"""How often the solved chain may change its mind about single views."""


def carried_on(views: PoseViews, symmetries: Sequence[TargetSymmetry], turnable: NDArray[np.bool_]) -> Array:
    """Return the poses (n, 4, 4), those of each camera read the way round of its first view.

    Views that are not `turnable` (n,) stay as they are: another system gave their poses.
    """
    poses = views.poses.copy()
    for camera in range(len(views.links)):
        own = np.flatnonzero(views.cameras == camera)
        for parent, child in _nearest_first(views.readings[own]):
            if turnable[own[child]]:
                poses[own[child]] = _nearest(poses[own[parent]], poses[own[child]], symmetries)
    return poses


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
        predicted = predicted_poses(solved, views)
        turned = np.array(
            [
                _nearest(expected, pose, symmetries) if free else pose
                for expected, pose, free in zip(predicted, poses, turnable, strict=True)
            ]
        )
        if np.array_equal(turned, poses):
            break
        poses, solved = turned, solve(turned)
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


def _nearest(expected: Array, pose: Array, symmetries: Sequence[TargetSymmetry]) -> Array:
    """Return `pose` read the way round in which its rotation is nearest to the `expected` pose's."""
    turned = np.array([pose, *(symmetry.turned_from_world @ pose for symmetry in symmetries)])
    _, angles = pose_error(np.broadcast_to(expected, turned.shape), turned)
    return np.asarray(turned[int(np.argmin(angles))])


def _nearest_first(readings: Array) -> list[tuple[int, int]]:
    """Return edges (parent, child) of the minimum spanning tree of the readings, from the first on (Prim)."""
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
        edges.append((int(parent[newest]), newest))
    return edges
