"""A kinematic model from a drawing: where the fit starts when joints were not exercised one by one, and its prior.

The drawing gives the chain in its own base. Where that base and the camera are is found first, from the camera's poses
(robot-world and hand-eye at once); then the drawing's standard deviations become knowledge about the screws.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.chain import Chain
from calib.closed_form import PoseViews, mean_mount
from calib.errors import UnsolvableError
from calib.first_solution import CameraViews, read_one_way
from calib.held_chain import held_chain
from calib.likelihood.state import joint_basis
from calib.observations import Observation
from calib.orientation import Solved
from calib.session import DhRow, Nominal, Session
from calib.solution import Solution
from calib.transforms import any_normal, inverse, nearest_rotation, rotation_log, transform
from calib.twists import exp_twist

Array = NDArray[np.float64]

FEWEST_VIEWS = 3
STEP = 1e-6
UNSAID = 0.1
"""Standard deviation, relative to the drawing's, of what D-H rows cannot say, such as a tilt of parallel axes."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A nominal chain in the world: its base (4, 4), and the camera's pose at all readings 0 `mount` (4, 4)."""

    chain: Chain
    mount: Array
    world_from_base: Array


def nominal_solution(
    session: Session, nominal: Nominal, observations: Sequence[Observation], seen: CameraViews
) -> Solution:
    """Return the drawing's chain placed in the world, with what it knows as prior.

    The first camera places it; others are put where their own views have them. Raises UnsolvableError.
    """
    kinds = [joint.kind for joint in session.joints]

    def place(views: PoseViews) -> Placed:
        own = (views.cameras == 0) & (views.links[0] == len(kinds))
        return placed(nominal, kinds, views.poses[own], views.readings[own])

    def solve(views: PoseViews) -> Solved:
        found = place(views)
        others = [mean_mount(found.chain, views, camera) for camera in range(1, len(views.links))]
        return found.chain, np.array([found.mount, *others])

    read = read_one_way(session, observations, seen, solve)
    found = place(read.views)
    return Solution(
        held_chain(session, found.chain),
        read.solved[1],
        seen.lenses,
        origin=read.origin,
        undecided=read.undecided,
        prior=prior_information(nominal, kinds, found),
        world_from_base=found.world_from_base,
    )


def nominal_chain(nominal: Nominal, kinds: Sequence[str]) -> tuple[Chain, Array]:
    """Return the drawing's chain in its base, and base_from_flange (4, 4) at all readings 0.

    Standard D-H is Rz(theta) Tz(d) Tx(a) Rx(alpha), moved at its beginning; modified is Tx(a) Rx(alpha) Tz(d)
    Rz(theta), moved at its end.
    """
    frame = np.eye(4)
    axes, points = [], []
    for row in nominal.dh:
        if nominal.convention == "modified_dh":
            frame = frame @ _along(0, row.a, row.alpha)
            axes.append(frame[:3, 2])
            points.append(frame[:3, 3])
            frame = frame @ _along(2, row.d, row.theta)
        else:
            axes.append(frame[:3, 2])
            points.append(frame[:3, 3])
            frame = frame @ _along(2, row.d, row.theta) @ _along(0, row.a, row.alpha)
    return Chain.of(kinds, axes, points, [row.scale for row in nominal.dh]), frame


def placed(nominal: Nominal, kinds: Sequence[str], poses: Array, readings: Array) -> Placed:
    """Return the drawing's chain where it explains the camera's `poses` (n, 4, 4) at `readings` (n, m) best.

    Raises UnsolvableError for too few views, or views that turn about one direction only.
    """
    chain, flange = nominal_chain(nominal, kinds)
    motions = chain.displacement(readings) @ flange
    world_from_base, flange_from_camera = _robot_world_hand_eye(motions, poses)
    return Placed(
        carried(chain, world_from_base), world_from_base @ flange @ flange_from_camera, world_from_base
    )


def carried(chain: Chain, motion: Array) -> Chain:
    """Return the chain moved as a whole by `motion` (4, 4)."""
    points = chain.points @ motion[:3, :3].T + motion[:3, 3]
    return Chain(chain.revolute, chain.axes @ motion[:3, :3].T, points, chain.scales)


def _along(axis: int, distance: float, angle: float) -> Array:
    twist = np.zeros(6)
    twist[axis], twist[3 + axis] = angle, distance
    return exp_twist(twist)


def _robot_world_hand_eye(motions: Array, poses: Array) -> tuple[Array, Array]:
    """Return world_from_base and flange_from_camera with poses = world_from_base motions flange_from_camera.

    Rotations from one homogeneous system (Shah 2013), then positions from a linear one.
    """
    count = len(poses)
    if count < FEWEST_VIEWS:
        raise UnsolvableError(
            f"a nominal model needs {FEWEST_VIEWS} views or more to be placed, and {count} are seen"
        )
    # R_motion R_mount = R_base' R_pose for all views, in the columns of both unknowns.
    rows = np.zeros((count, 9, 18))
    for view in range(count):
        rows[view, :, :9] = np.kron(np.eye(3), motions[view, :3, :3])
        rows[view, :, 9:] = -np.kron(poses[view, :3, :3].T, np.eye(3))
    _, sizes, vectors = np.linalg.svd(rows.reshape(-1, 18))
    if sizes[-2] < 1e-3 * sizes[0]:
        raise UnsolvableError(
            "the views turn the camera about one direction only, which does not place a nominal model: "
            "take some that turn it about others"
        )
    mount, base = vectors[-1, :9].reshape(3, 3).T, vectors[-1, 9:].reshape(3, 3).T
    sign = np.sign(np.linalg.det(mount))
    mount, base = nearest_rotation(sign * mount), nearest_rotation(sign * base).T
    left = np.concatenate([base @ motions[:, :3, :3], np.broadcast_to(np.eye(3), (count, 3, 3))], axis=2)
    right = poses[:, :3, 3] - motions[:, :3, 3] @ base.T
    shifts = np.linalg.lstsq(left.reshape(-1, 6), right.ravel(), rcond=None)[0]
    return transform(base, shifts[3:]), transform(mount, shifts[:3])


def prior_information(nominal: Nominal, kinds: Sequence[str], at: Placed) -> Array:
    """Return what the drawing knows (p, p) of a step of chain and mount away from `at`, in the fit's own parameters.

    Base and mount are not in the drawing, and are left free.
    """
    rows = np.array([[row.a, row.alpha, row.d, row.theta, row.scale] for row in nominal.dh])
    spread = np.array(
        [nominal.std.length, nominal.std.angle, nominal.std.length, nominal.std.angle, nominal.std.scale]
    )
    columns = []
    for joint in range(len(rows)):
        for entry in range(5):
            changed = rows.copy()
            changed[joint, entry] += STEP
            columns.append(_coordinates(_varied(nominal, kinds, changed, at), at) / STEP * spread[entry])
    known = np.column_stack(columns)
    free = []
    for twist in np.eye(6):
        base = exp_twist(STEP * twist)
        free.append(_coordinates((carried(at.chain, base), base @ at.mount), at) / STEP)
        free.append(_coordinates((at.chain, at.mount @ exp_twist(STEP * twist)), at) / STEP)
    unsaid = UNSAID * _sizes(at.chain, nominal)
    information = np.linalg.inv(known @ known.T + np.diag(unsaid**2))
    directions = np.column_stack(free)
    # Whatever base and mount can explain costs nothing: their directions are projected out.
    blind = information @ directions
    return information - blind @ np.linalg.pinv(directions.T @ blind) @ blind.T


def _varied(nominal: Nominal, kinds: Sequence[str], rows: Array, at: Placed) -> tuple[Chain, Array]:
    """Return chain and mount in the world for other D-H rows, base and flange_from_camera as they are at `at`."""
    names = ("a", "alpha", "d", "theta", "scale")
    varied = nominal.model_copy(
        update={"dh": [DhRow(**dict(zip(names, row.tolist(), strict=True))) for row in rows]}
    )
    _, flange = nominal_chain(nominal, kinds)
    chain, moved_flange = nominal_chain(varied, kinds)
    on_flange = inverse(at.world_from_base @ flange) @ at.mount
    return carried(chain, at.world_from_base), at.world_from_base @ moved_flange @ on_flange


def _coordinates(other: tuple[Chain, Array], at: Placed) -> Array:
    """Return the fit's step (p,) that leads from `at` to a chain and mount close by."""
    chain, mount = other
    entries: list[float] = []
    for joint in range(len(chain)):
        axis, point = at.chain.axes[joint], at.chain.points[joint]
        first = any_normal(axis)
        normals = np.array([first, np.cross(axis, first)])
        entries += (normals @ np.cross(axis, chain.axes[joint])).tolist()
        if chain.revolute[joint]:
            away = chain.points[joint] - point
            entries += (normals @ (away - (away @ chain.axes[joint]) * chain.axes[joint])).tolist()
        entries.append(float(np.log(chain.scales[joint] / at.chain.scales[joint])))
    motion = inverse(at.mount) @ mount
    return np.array([*entries, *rotation_log(motion[None])[0], *motion[:3, 3]])


def _sizes(chain: Chain, nominal: Nominal) -> Array:
    """Return the drawing's standard deviation (p,) for each of the fit's parameters, by its kind."""
    sizes: list[float] = []
    for joint in range(len(chain)):
        count = joint_basis(chain, joint).shape[1]
        sizes += [nominal.std.angle] * 2 + [nominal.std.length] * (count - 2) + [nominal.std.scale]
    return np.array(sizes + [nominal.std.angle] * 3 + [nominal.std.length] * 3)
