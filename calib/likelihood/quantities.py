"""What a rig is known by, in a person's terms: scales, axes, lenses, and where each camera stands.

The parameters' own uncertainties are of a rig at readings 0, which may lie far outside of where it was looked at. What
is asked about here is the rig amid its readings: each axis as the first camera sees it from there, each camera before
its target. Every quantity is divided by what it may be off by before it matters.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.likelihood.problem import Problem
from calib.likelihood.state import State, joint_basis
from calib.transforms import any_normal, inverse
from calib.twists import adjoint, joint_screw, skew

Array = NDArray[np.float64]

Kind = Literal["scale", "direction", "place", "focal_length", "principal_point", "stand", "look"]

RELATIVE = 0.01
"""What a length, a scale or a focal length may be off by, relative to it, before it matters."""
ANGLE = float(np.radians(0.5))
"""And a direction, in rad."""


@dataclass(frozen=True, eq=False)
class Quantity:
    """A quantity of the joint or camera called `owner`: how its numbers change with the parameters (k, p).

    `rows` are in units of `tolerance`, which is in rad, in m, or relative; `relative` tells which.
    """

    kind: Kind
    owner: str
    rows: Array
    tolerance: float

    def std(self, covariance: Array) -> float:
        """Return the standard deviation of its worst known direction, in units of the tolerance."""
        return float(np.sqrt(np.linalg.eigvalsh(self.rows @ covariance @ self.rows.T)[-1].clip(0)))

    def worst(self, covariance: Array) -> Array:
        """Return the derivative (p,) of its worst known direction by the parameters."""
        vectors = np.linalg.eigh(self.rows @ covariance @ self.rows.T)[1]
        return np.asarray(vectors[:, -1] @ self.rows)


@dataclass(frozen=True, eq=False)
class Amid:
    """The chain amid its readings.

    `twists` (m, 6, p) and `motions` (c, 6, p) are how each joint's screw and each camera move in the world with the
    parameters, `frames` (m, 4, 4) what carries each joint from readings 0, `poses` (c, 4, 4) the cameras'.
    """

    twists: list[Array]
    motions: list[Array]
    frames: list[Array]
    poses: list[Array]


def quantities(
    problem: Problem, state: State, joints: Sequence[str], cameras: Sequence[str], centre: Array
) -> list[Quantity]:
    """Return what can be asked about a fit with these joints and cameras; `centre` (3,) is the target's, in m."""
    layout, seen = problem.layout, np.concatenate([group.data.views for group in problem.groups])
    readings = problem.readings[seen]
    amid = _amid(problem, state, (readings.min(axis=0) + readings.max(axis=0)) / 2)
    distances = [max(float(np.linalg.norm(pose[:3, 3] - centre)), 1e-9) for pose in amid.poses]
    found: list[Quantity] = []
    for joint, name in enumerate(joints):
        scale = np.zeros((1, len(layout)))
        scale[0, layout.scales[joint]] = 1 / RELATIVE
        found.append(Quantity("scale", name, scale, RELATIVE))
        found += _axis(state, amid, joint, name, distances[0])
    for camera, name in enumerate(cameras):
        lens = state.lenses[camera]
        if lens is not None:
            numbers = np.zeros((4, len(layout)))
            numbers[:, layout.lenses[camera]] = layout.lens_changes[camera][:4]
            numbers /= RELATIVE * lens[:2].mean()
            found.append(Quantity("focal_length", name, numbers[:2], RELATIVE))
            found.append(Quantity("principal_point", name, numbers[2:], RELATIVE))
        own = adjoint(inverse(amid.poses[camera])) @ amid.motions[camera]
        reach = RELATIVE * distances[camera]
        found.append(Quantity("stand", name, own[3:] / reach, reach))
        found.append(Quantity("look", name, own[:3] / ANGLE, ANGLE))
    return found


def _axis(state: State, amid: Amid, joint: int, name: str, distance: float) -> list[Quantity]:
    """Return the direction of a joint's axis and, if it turns, where it lies, both as the first camera sees it."""
    frame, camera = amid.frames[joint], amid.poses[0][:3, 3]
    axis = frame[:3, :3] @ state.chain.axes[joint]
    first = any_normal(axis)
    normals = np.array([first, np.cross(axis, first)])
    own = amid.twists[joint] - amid.motions[0]
    direction = Quantity("direction", name, normals @ own[:3] / ANGLE, ANGLE)
    if not state.chain.revolute[joint]:
        return [direction]
    point = frame[:3, :3] @ state.chain.points[joint] + frame[:3, 3]
    nearest = point + (camera - point) @ axis * axis
    moved, reach = own[3:] - skew(nearest) @ own[:3], RELATIVE * distance
    return [direction, Quantity("place", name, normals @ moved / reach, reach)]


def _amid(problem: Problem, state: State, at: Array) -> Amid:
    """Return the chain at the readings `at` (m,).

    A joint's motion E moves by eta - Ad(E) eta + S s v dlog(s) in the world when its screw moves by eta; what rides on
    it is carried along.
    """
    chain, layout, count = state.chain, problem.layout, len(problem.layout)
    frames, twists, carried = [np.eye(4)], [], [np.zeros((6, count))]
    for joint in range(len(chain)):
        before, moved = frames[-1], carried[-1]
        own = np.zeros((6, count))
        own[:, layout.shapes[joint]] = joint_basis(chain, joint)
        twists.append(moved + adjoint(before) @ own)
        motion = chain.motion(joint, at[joint : joint + 1])[0]
        change = own - adjoint(motion) @ own
        change[:, layout.scales[joint]] += joint_screw(chain, joint) * chain.scales[joint] * at[joint]
        carried.append(moved + adjoint(before) @ change)
        frames.append(before @ motion)
    links = {group.camera: group.link for group in problem.groups}
    poses, motions = [], []
    for camera, mount in enumerate(state.mounts):
        link = links[camera]
        poses.append(frames[link] @ mount)
        own = np.zeros((6, count))
        own[:, layout.mounts[camera]] = np.eye(6)
        motions.append(carried[link] + adjoint(poses[-1]) @ own)
    return Amid(twists, motions, frames[:-1], poses)
