"""How sure a calibration is of its D-H parameters and of its base: the screws' covariance, carried on. numpy alone.

Each axis moves by a twist eta of its own, and each frame by xi = eta + (u, w) about and along its axis, since it has
to stay where the common normals meet it. Between neighbours only the D-H parameters change, alpha and a about and
along the first one's X, theta and d about and along the second's axis, so that

    eta_2 - eta_1 = (u_1, w_1) Z_1 + (alpha, a) X_1 + (theta - u_2, d - w_2) Z_2.

These are six equations for as many unknowns. They are solved by cross products, and near-parallel axes, whose common
normal may lie anywhere, come out as uncertain as they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.chain import Chain
from calib.links import PARALLEL, Links, links_of
from calib.pose_covariance import joint_twists
from calib.transforms import inverse
from calib.twists import adjoint

Array = NDArray[np.float64]

MADE_NORMAL = 0.09
"""Cosine between the world's X, or Y, and a single joint's X that was made of it: `any_normal` wants 0.1."""
ENTRIES = ("a_prev", "alpha_prev", "d_offset", "theta_offset", "scale")


@dataclass(frozen=True, eq=False)
class DhCovariance:
    """The covariance of the D-H rows' `ENTRIES` (5 m, 5 m), row by row, and of the base, in its own frame (6, 6)."""

    rows: Array
    base: Array

    def std(self) -> list[dict[str, float]]:
        """Return the standard deviation of each entry of each row."""
        deviations = np.sqrt(np.diag(self.rows).clip(0)).reshape(-1, len(ENTRIES))
        return [dict(zip(ENTRIES, row, strict=True)) for row in deviations.tolist()]


def dh_covariance(chain: Chain, base: Array, parameters: Sequence[str], matrix: Array) -> DhCovariance:
    """Return the covariance of what `links_of` reads off the chain, with `base` (4, 4) in place of its own.

    `matrix` (p, p) is that of the document's numbers called `parameters`. The base's is of world_from_base Exp(xi),
    xi = (rotation, position); a drawing's base moves with the first axis.
    """
    rows, moved = dh_jacobian(chain, base, parameters)
    flat = rows.reshape(-1, len(parameters))
    return DhCovariance(flat @ matrix @ flat.T, moved @ matrix @ moved.T)


def dh_jacobian(chain: Chain, base: Array, parameters: Sequence[str]) -> tuple[Array, Array]:
    """Return the derivatives of the D-H rows (m, 5, p) and of the base in its own frame (6, p)."""
    count, size = len(chain), len(parameters)
    rows, own, rest = np.zeros((count, 5, size)), np.zeros((count, 2, size)), np.zeros((count, 2, size))
    if count == 0:
        return rows, np.zeros((6, size))
    twists, links = joint_twists(chain, parameters), links_of(chain)
    for joint in range(1, count):
        gap = twists[joint, :6] - twists[joint - 1, :6]
        own[joint - 1], rows[joint, 1::-1], rest[joint] = _neighbours(links, joint, gap, rest[joint - 1])
    # The last frame's X stays that of the frame before, at reading 0.
    own[-1] = -rest[-1] if count > 1 else _single(links.world_from_link[0], twists[0])
    rows[1:, 3:1:-1] = rest[1:] + own[1:]
    rows[:, 4] = chain.scales[:, None] * twists[:, 6]
    standing = own[0]
    if not np.allclose(base, links.world_from_base, atol=1e-9):
        # A drawing's base turns and slides as little as it can, and the first row tells the rest.
        standing = -np.array([base[:3, 2] @ twists[0, :3], base[:3, 2] @ _at(base[:3, 3], twists[0])])
        rows[0, 3:1:-1] = own[0] - standing
    return rows, adjoint(inverse(base)) @ (twists[0, :6] + _about(base, standing))


def _neighbours(links: Links, joint: int, gap: Array, rest: Array) -> tuple[Array, Array, Array]:
    """Return (u, w) of the frame before `joint`, (alpha, a) between, and (theta - u, d - w) of its own, (2, p) each.

    `gap` (6, p) is by how much its axis moves more than the one before, `rest` the latter's own (theta - u, d - w).
    """
    before, axis, a = (
        links.world_from_link[joint - 1],
        links.world_from_link[joint][:3, 2],
        links.rows[joint].a_prev,
    )
    x, y, z, origin = before[:3].T
    turn, shift = gap[:3], _at(origin, gap)
    sine = float(x @ np.cross(z, axis))
    if sine >= PARALLEL:
        first, second = np.cross(axis, x) / sine, np.cross(x, z) / sine
        u, theta = first @ turn, second @ turn
        shift = shift + np.outer(np.cross(axis, x), a * theta)
        w, d = first @ shift, second @ shift
    else:
        # The common normal keeps its foot, and turns as one axis goes round the other.
        same, apart = np.sign(z @ axis), abs(a) > PARALLEL
        theta = -same * (y @ shift) / a if apart else same * (z @ turn + rest[0])
        # A tilt sends it to infinity, and coaxial axes that part turn it anywhere.
        astray = (y @ turn if apart else y @ (turn + shift)) / PARALLEL
        theta = theta - same * astray
        u = z @ turn - same * theta
        shift = shift + np.outer(np.cross(axis, x), a * theta)
        w = astray - rest[1]
        d = same * (z @ shift - w)
    return np.array([u, w]), np.array([x @ turn, x @ shift]), np.array([theta, d])


def _at(point: Array, twist: Array) -> Array:
    """Return how `point` (3,) moves with twists (6 or more, p)."""
    return np.asarray(twist[3:6] - np.cross(point, twist[:3], axisb=0, axisc=0))


def _about(frame: Array, moves: Array) -> Array:
    """Return the twists (6, p) of turning about and sliding along a frame's Z by `moves` (2, p)."""
    z, origin = frame[:3, 2], frame[:3, 3]
    turn = np.outer(z, moves[0])
    return np.concatenate([turn, np.outer(np.cross(origin, z), moves[0]) + np.outer(z, moves[1])])


def _single(frame: Array, twist: Array) -> Array:
    """Return (u, w) (2, p) of the frame of a single joint, whose X is the world's X or Y made normal to its axis."""
    x, _, z = frame[:3, :3].T
    wanted = next(direction for direction in np.eye(3) if x @ direction > MADE_NORMAL)
    u = (z @ wanted) / (x @ wanted) * (x @ twist[:3]) - z @ twist[:3]
    return np.array([u, np.zeros_like(u)])
