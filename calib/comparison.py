"""Two calibrations of one rig: whether they say the same, and if not, whether it was the target that moved.

Each is taken to have errors of its own. Two that were solved from the same views share most of theirs, and agree better
than their standard deviations promise.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import degrees

import numpy as np
from numpy.typing import NDArray

from calib.calibration import Calibration
from calib.errors import CalibError
from calib.stated_parameters import Frame, StatedParameter, stated_parameters
from calib.transforms import nearest_rotation, pose_error, rotation_log, transform

Array = NDArray[np.float64]

SURELY = 3.0
"""Standard deviations beyond which a difference is one."""
SAME = 1e-9
"""Metres and radians within which two poses are one: a sum's rounding, far below what can be measured."""
MOST_JOINTS = 6
"""Up to so many joints the range is looked at in its middle, too, and not at its ends alone."""


@dataclass(frozen=True)
class ParameterDifference:
    """A parameter in both, the difference (second less first), its standard deviation, and how many of it that is."""

    name: str
    unit: str
    frame: Frame
    first: float
    second: float
    difference: float
    std: float | None
    stds: float | None


@dataclass(frozen=True)
class PoseDifference:
    """How far the camera's poses are apart: on the mean and at most (m, rad), and at most in standard deviations."""

    position_mean_m: float
    position_max_m: float
    rotation_mean_rad: float
    rotation_max_rad: float
    stds: float | None


@dataclass(frozen=True)
class Comparison:
    """Two calibrations over the `range` of readings ([lowest, highest] a joint) that both have.

    `poses` are compared in the world, and `poses_apart_from_world` once the one's world is moved onto the other's as
    well as can be: by `moved_m` at the target's origin, and by `moved_rad`. `agree` says which of the two is within
    what is to be expected, None where that is not known.
    """

    sentence: str
    agree: bool | None
    agree_apart_from_world: bool | None
    range: list[list[float]]
    poses: PoseDifference
    poses_apart_from_world: PoseDifference
    moved_m: float
    moved_rad: float
    parameters: list[ParameterDifference]


def compare(first: Calibration, second: Calibration) -> Comparison:
    """Compare two calibrations of one rig's joints.

    Raises CalibError where they are of other joints, have no range in common, or do not know where the camera is.
    """
    _require_comparable(first, second)
    common = _common_range(first, second)
    readings = _spread_over(common)
    a, b = first.world_from_camera(readings), second.world_from_camera(readings)
    variances = _variances(first, second, readings)
    moved = _world_moved(a, b)
    poses = _difference(a, b, variances)
    apart = _difference(moved @ a, b, variances)
    parameters = _parameters(first, second)
    agree, agree_apart = _within(poses), _within(apart)
    moved_m, moved_rad = (
        float(np.linalg.norm(moved[:3, 3])),
        float(np.linalg.norm(rotation_log(moved[None])[0])),
    )
    return Comparison(
        sentence=_sentence(poses, apart, moved_m, moved_rad, parameters),
        agree=agree,
        agree_apart_from_world=agree_apart,
        range=common,
        poses=poses,
        poses_apart_from_world=apart,
        moved_m=moved_m,
        moved_rad=moved_rad,
        parameters=parameters,
    )


def _require_comparable(first: Calibration, second: Calibration) -> None:
    ours, theirs = (
        [(joint.name, joint.kind, joint.reading_unit) for joint in calibration.joints]
        for calibration in (first, second)
    )
    if ours != theirs or not ours:
        names = [", ".join(name for name, *_ in joints) or "none" for joints in (ours, theirs)]
        raise CalibError(f"calibrations of other joints cannot be compared: {names[0]}, and {names[1]}")


def _common_range(first: Calibration, second: Calibration) -> list[list[float]]:
    common = []
    for joint, (low, high), (other_low, other_high) in zip(
        first.joints, first.range, second.range, strict=True
    ):
        lowest, highest = max(low, other_low), min(high, other_high)
        if lowest > highest:
            raise CalibError(f"the calibrations have no range of '{joint.name}' in common")
        common.append([lowest, highest])
    return common


def _spread_over(ranges: Sequence[Sequence[float]]) -> Array:
    """Return readings (n, m) at the ends of all ranges, and in their middles."""
    count = 3 if len(ranges) <= MOST_JOINTS else 2
    return np.array(list(product(*(np.linspace(low, high, count).tolist() for low, high in ranges))))


def _variances(first: Calibration, second: Calibration, readings: Array) -> Array | None:
    """Return the variances (n, 2) of rotation and position, all directions together; None where not known."""
    total = np.zeros((len(readings), 2))
    for calibration in (first, second):
        known = calibration.pose_covariance(readings)
        if known is None:
            return None
        variances = np.diagonal(known, axis1=1, axis2=2)
        total += np.stack([variances[:, :3].sum(axis=1), variances[:, 3:].sum(axis=1)], axis=1)
    return total


def _world_moved(a: Array, b: Array) -> Array:
    """Return the rigid motion (4, 4) that takes the poses `a` (n, 4, 4) nearest to `b`."""
    rotation = nearest_rotation((b[:, :3, :3] @ np.swapaxes(a[:, :3, :3], 1, 2)).mean(axis=0))
    return transform(rotation, (b[:, :3, 3] - a[:, :3, 3] @ rotation.T).mean(axis=0))


def _difference(a: Array, b: Array, variances: Array | None) -> PoseDifference:
    distances, angles = pose_error(a, b)
    stds = None
    if variances is not None:
        both = np.stack([angles, distances], axis=1) / np.sqrt(np.maximum(variances, 1e-30))
        stds = float(both.max())
    return PoseDifference(
        float(distances.mean()), float(distances.max()), float(angles.mean()), float(angles.max()), stds
    )


def _within(difference: PoseDifference) -> bool | None:
    return None if difference.stds is None else difference.stds <= SURELY


def _parameters(first: Calibration, second: Calibration) -> list[ParameterDifference]:
    others = {parameter.name: parameter for parameter in stated_parameters(second)}
    return [
        _parameter(parameter, others[parameter.name])
        for parameter in stated_parameters(first)
        if parameter.name in others
    ]


def _parameter(one: StatedParameter, other: StatedParameter) -> ParameterDifference:
    difference = other.value - one.value
    if one.unit == "rad":
        difference = float(np.angle(np.exp(1j * difference)))
    std = None if one.std is None or other.std is None else float(np.hypot(one.std, other.std))
    stds = None if not std else abs(difference) / std
    return ParameterDifference(one.name, one.unit, one.frame, one.value, other.value, difference, std, stds)


def _sentence(
    poses: PoseDifference,
    apart: PoseDifference,
    moved_m: float,
    moved_rad: float,
    parameters: Sequence[ParameterDifference],
) -> str:
    if max(poses.position_max_m, poses.rotation_max_rad) < SAME:
        return "They say the same: over the range that both have, every pose of the camera is equal"
    if poses.stds is None or apart.stds is None:
        return f"Over the range that both have, {_by(poses)}; how much is to be expected is not known"
    if poses.stds <= SURELY:
        return f"They agree: over the range that both have, {_by(poses)}"
    if apart.stds <= SURELY:
        return (
            f"The target stood elsewhere, by {1e3 * moved_m:.3g} mm and {degrees(moved_rad):.2g} deg; "
            f"apart from that they agree: {_by(apart)}"
        )
    own = [one for one in parameters if one.frame == "none" and one.stds is not None]
    worst = max(own, key=lambda one: one.stds or 0.0, default=None)
    most = (
        ""
        if worst is None or worst.stds is None
        else f"; most of all {worst.name}, by {worst.stds:.2g} of its own"
    )
    return f"They differ: over the range that both have, {_by(poses)}{most}"


def _by(poses: PoseDifference) -> str:
    expected = "" if poses.stds is None else f", up to {poses.stds:.2g} standard deviations"
    return (
        f"the camera's position differs by {1e3 * poses.position_mean_m:.2g} mm (at most "
        f"{1e3 * poses.position_max_m:.2g}) and its rotation by {1e3 * poses.rotation_mean_rad:.2g} mrad (at most "
        f"{1e3 * poses.rotation_max_rad:.2g}){expected}"
    )
