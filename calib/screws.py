"""The screw of one joint from camera poses while it alone moved (step 1, eq 23 to 31, corrected).

Each pair of views of one sweep gives a motion of the link, H_12 = world_from_camera_2 camera_1_from_world
(eq 24), hence an axis, a point and an angle; their weighted means are the screw (eq 31). All pairs are
used, not only those with the start, so that the start's own error averages out, and the means are Huber's,
so that a knocked view does not spoil the joint.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.errors import UnsolvableError
from calib.transforms import rotation_log

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

HUBER = 1.345
HUBER_PASSES = 12
SETTLED = 1e-3
"""By how much of its standard deviation a mean may still move."""
CHI_MEDIAN = {1: 0.6745, 2: 1.1774}
HALF_A_TURN = 0.98 * np.pi
UNEVEN = 0.3
"""How far (rad) a turn may be from what the other readings say of it: more than any noise, less than a mistake."""
MANY = 0.25
"""Part of the turns that may be uneven before the readings as a whole are in doubt: single views may be knocked."""
NOISE = 3.0
"""Over a sweep a joint moves the camera by more than so many times what neighbouring views scatter by."""
NOTHING = 1e-9  # rad, or m
MAX_STRIDES = 48
"""In a sweep of more views than this, pairs are taken at this many distances along it."""


@dataclass(frozen=True, eq=False)
class Screw:
    """A joint's axis in the world: unit `axis` (3,) along growing readings, `point` (3,) in m, `scale` > 0.

    `point` is the axis point nearest the world's origin; a prismatic joint has none of its own and carries
    zeros.
    """

    axis: Array
    point: Array
    scale: float


def revolute_screw(poses: Array, readings: Array, sweeps: Ints, name: str, unit: float | None) -> Screw:
    """Return the screw of a revolute joint.

    `poses` (n, 4, 4) are world_from_camera, `readings` (n,) the joint's own, `sweeps` (n,) tells which
    views were taken one after the other with all else at rest. `unit` is the radians that one reading
    nominally is, if known. Raises UnsolvableError where the readings do not decide the angle, or the joint
    did not turn.
    """
    rate = _turning_rate(poses, readings, sweeps, name, unit)
    speed = float(np.linalg.norm(rate))
    first, second = _pairs(readings, sweeps)
    step = readings[second] - readings[first]
    turn = rotation_log(poses[second, :3, :3] @ np.swapaxes(poses[first, :3, :3], -1, -2))
    angle = np.linalg.norm(turn, axis=1)
    # A rotation leaves the sign of its angle and the number of whole turns open: the rate decides.
    sign = np.where(turn @ rate < 0, -1.0, 1.0)
    angle = sign * angle
    direction = np.divide(turn, angle[:, None], out=np.zeros_like(turn), where=np.abs(angle[:, None]) > 0)
    angle = angle + 2 * np.pi * np.round((speed * step - angle) / (2 * np.pi))
    half_sine, half_cosine = np.sin(angle / 2), np.cos(angle / 2)
    information = half_sine**2
    if information.sum() < 1e-12:
        raise UnsolvableError(
            f"joint '{name}' did not turn, or by whole turns only: take views at readings in between"
        )
    axis = robust_mean(direction, information, 2)
    axis /= np.linalg.norm(axis)
    start, end = poses[first, :3, 3], poses[second, :3, 3]
    # cos / sin grows without bound at whole turns, where the information vanishes.
    cotangent = half_cosine / np.where(information > 1e-24, half_sine, np.inf)
    points = (start + end + np.cross(axis, end - start) * cotangent[:, None]) / 2
    points -= np.outer(points @ axis, axis)
    point = robust_mean(points, information, 2)
    return Screw(axis, point, float(robust_mean((angle / step)[:, None], step**2, 1)[0]))


def prismatic_screw(poses: Array, readings: Array, sweeps: Ints, name: str) -> Screw:
    """Return the screw of a prismatic joint (eq 29, 30); arguments as for `revolute_screw`.

    Raises UnsolvableError where it did not move.
    """
    first, second = _pairs(readings, sweeps)
    step = readings[second] - readings[first]
    travel = poses[second, :3, 3] - poses[first, :3, 3]
    length = np.linalg.norm(travel, axis=1)
    near, far = _neighbours(readings, sweeps)
    _check_moved(poses[far, :3, 3] - poses[near, :3, 3], readings, near, far, sweeps, name)
    direction = travel / np.maximum(length, 1e-300)[:, None]
    axis = robust_mean(direction, length**2, 2)
    axis /= np.linalg.norm(axis)
    return Screw(axis, np.zeros(3), float(robust_mean((travel @ axis / step)[:, None], step**2, 1)[0]))


def robust_mean(values: Array, information: Array, dof: int) -> Array:
    """Return Huber's mean (k,) of `values` (p, k), each known to 1 / sqrt(`information`) (p,) in `dof` ways.

    The common scale of the deviations comes from their median (Huber 1981, with his 95 % efficient constant).
    """
    weights, root, mean = information, np.sqrt(information), np.full(values.shape[1], np.inf)
    for _ in range(HUBER_PASSES):
        before, mean = mean, np.asarray(weights @ values / weights.sum(), dtype=float)
        deviation = np.linalg.norm(values - mean, axis=1) * root
        spread = np.median(deviation) / CHI_MEDIAN[dof]
        if np.linalg.norm(mean - before) * np.sqrt(information.sum()) <= SETTLED * spread:
            break
        weights = information / np.maximum(1, deviation / (HUBER * max(spread, 1e-300)))
    return mean


def _turning_rate(poses: Array, readings: Array, sweeps: Ints, name: str, unit: float | None) -> Array:
    """Return the rotation vector per reading (3,), from neighbouring readings less than half a turn apart."""
    first, second = _neighbours(readings, sweeps)
    step = readings[second] - readings[first]
    if unit is not None and unit * step.max() > HALF_A_TURN:
        raise UnsolvableError(
            f"neighbouring views of joint '{name}' must be less than half a turn apart, "
            "or the angle between them cannot be decided: take views in between"
        )
    turn = rotation_log(poses[second, :3, :3] @ np.swapaxes(poses[first, :3, :3], -1, -2))
    rate = robust_mean(turn / step[:, None], step**2, 2)
    uneven = np.linalg.norm(turn - step[:, None] * rate, axis=1) > UNEVEN
    if uneven.mean() > MANY:
        raise UnsolvableError(
            f"the camera's turns between neighbouring views of joint '{name}' do not grow with its readings: "
            "these must be less than half a turn apart, so take views in between, or look for wrong readings"
        )
    if np.abs(turn).max() > NOTHING:  # whole turns are another matter
        _check_moved(turn, readings, first, second, sweeps, name)
    return rate


def _check_moved(motions: Array, readings: Array, first: Ints, second: Ints, sweeps: Ints, name: str) -> None:
    """Raise UnsolvableError where the camera's `motions` (p, 3) between neighbours are no more than noise."""
    step = readings[second] - readings[first]
    rate = robust_mean(motions / step[:, None], step**2, 2)
    span = np.bincount(sweeps[first], weights=step).max()
    scatter = np.median(np.linalg.norm(motions - step[:, None] * rate, axis=1))
    if span * np.linalg.norm(rate) <= max(NOISE * scatter, NOTHING):
        raise UnsolvableError(stood_still(name))


def stood_still(name: str) -> str:
    """Say that a joint's readings changed, and the camera did not move."""
    return (
        f"joint '{name}' did not move the camera, though its readings changed: is its motor powered, and coupled to "
        "the axis, and are its readings and its kind right?"
    )


def _neighbours(readings: Array, sweeps: Ints) -> tuple[Ints, Ints]:
    order = np.lexsort((readings, sweeps))
    first, second = order[:-1], order[1:]
    kept = (sweeps[first] == sweeps[second]) & (readings[second] > readings[first])
    return first[kept], second[kept]


def _pairs(readings: Array, sweeps: Ints) -> tuple[Ints, Ints]:
    """Return the pairs of views of one sweep, each with growing reading."""
    firsts, seconds = [], []
    for sweep in np.unique(sweeps):
        members = np.flatnonzero(sweeps == sweep)
        members = members[np.argsort(readings[members], kind="stable")]
        count = len(members)
        strides = np.unique(np.geomspace(1, max(count - 1, 1), MAX_STRIDES).round().astype(int))
        if count <= MAX_STRIDES:
            strides = np.arange(1, count)
        firsts += [members[: count - stride] for stride in strides]
        seconds += [members[stride:] for stride in strides]
    first = np.concatenate(firsts) if firsts else np.zeros(0, dtype=np.intp)
    second = np.concatenate(seconds) if seconds else np.zeros(0, dtype=np.intp)
    kept = readings[second] > readings[first]
    return first[kept], second[kept]
