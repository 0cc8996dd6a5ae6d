"""Link frames and D-H parameters read off the joint screws (the paper's step 2, eq 32 to 65, corrected).

The screws are taken at all readings 0, where the zero-offsets are the parameters themselves. X of a frame is
the common normal from its own axis to the next one. For axes that are not parallel it is always
Z1 x Z2, with a signed length along it and a twist in (0, pi): so it stays continuous where axes intersect.
Near-parallel axes are ill-conditioned in any D-H model, the normal runs off to infinity: poses are computed
from the screws.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.chain import Chain
from calib.transforms import any_normal, transform

Array = NDArray[np.float64]

NEARLY_THE_SAME = 0.1
PARALLEL = 1e-10
"""Sine of the angle between two axes below which they count as parallel."""


@dataclass(frozen=True)
class DhParameters:
    """One modified D-H row: from the previous frame to this joint's at reading 0 (m, rad)."""

    a_prev: float
    alpha_prev: float
    d_offset: float
    theta_offset: float


@dataclass(frozen=True, eq=False)
class Links:
    """Frames at all readings 0: `world_from_base` (4, 4), `world_from_link` (m, 4, 4); and the D-H rows."""

    world_from_base: Array
    world_from_link: Array
    rows: list[DhParameters]


def links_of(chain: Chain) -> Links:
    """Return base, link frames and D-H rows of `chain`.

    The base coincides with frame 1 at reading 0 (eq 12), the last frame's X with that of the one before at
    reading 0 (eq 13). A single joint's frame stands at its point with the world's X, or Y, made normal to it.
    """
    count = len(chain)
    if count == 0:
        return Links(np.eye(4), np.zeros((0, 4, 4)), [])
    frames = np.zeros((count, 4, 4))
    rows: list[DhParameters] = []
    foot, previous_x = chain.points[0], None
    for i in range(count):
        axis = chain.axes[i]
        if i + 1 < count:
            x, origin, next_foot = common_normal(
                axis, foot, chain.axes[i + 1], chain.points[i + 1], previous_x
            )
        else:
            x, origin, next_foot = _last_x(axis, previous_x), foot, foot
        frames[i] = transform(np.column_stack([x, np.cross(axis, x), axis]), origin)
        if i == 0:
            rows.append(DhParameters(0.0, 0.0, 0.0, 0.0))
        else:
            rows.append(_row(frames[i - 1], frames[i], foot))
        foot, previous_x = next_foot, x
    return Links(frames[0].copy(), frames, rows)


def based(links: Links, base: Array) -> Links:
    """Return the links with the base of a drawing (4, 4) in place of the paper's, brought onto the first axis.

    Its origin moves to the nearest point of the axis, its X is made normal to it, and the first row gets offsets. A
    base that does not stand on the first axis, within a few degrees, cannot be said in D-H: then the paper's stays.
    """
    first = links.world_from_link[0]
    axis = first[:3, 2]
    if base[:3, 2] @ axis < np.cos(NEARLY_THE_SAME):
        return links
    origin = first[:3, 3] + ((base[:3, 3] - first[:3, 3]) @ axis) * axis
    x = any_normal(axis, base[:3, 0], base[:3, 1])
    standing = transform(np.column_stack([x, np.cross(axis, x), axis]), origin)
    row = _row(standing, first, origin)
    offsets = DhParameters(0.0, 0.0, row.d_offset, row.theta_offset)
    return Links(standing, links.world_from_link, [offsets, *links.rows[1:]])


def common_normal(
    axis: Array, point: Array, next_axis: Array, next_point: Array, previous_x: Array | None
) -> tuple[Array, Array, Array]:
    """Return X, its foot O on this axis and its foot P on the next (eq 34 to 37, 43, 53 to 59, corrected).

    Parallel axes take O at `point`; coaxial ones any X normal to the axis, for which `previous_x` is tried
    first.
    """
    cross, cosine, between = np.cross(axis, next_axis), float(axis @ next_axis), next_point - point
    sine = np.linalg.norm(cross)
    if sine >= PARALLEL:
        # c^2 - 1 loses all its digits near parallel axes; the cross product keeps them.
        origin = point + (between @ (axis - cosine * next_axis)) / sine**2 * axis
        foot = next_point + (between @ (cosine * axis - next_axis)) / sine**2 * next_axis
        return cross / sine, origin, foot
    foot = next_point - (next_axis @ between) * next_axis
    gap = foot - point
    distance = np.linalg.norm(gap)
    if distance <= PARALLEL * max(1.0, float(np.linalg.norm(between))):
        return _last_x(axis, previous_x), point, point
    # Rounding leaves the gap a little off the normal, where it would tilt the frame.
    x = gap - (gap @ axis) * axis
    return x / np.linalg.norm(x), point, foot


def _last_x(axis: Array, previous_x: Array | None) -> Array:
    return any_normal(axis) if previous_x is None else any_normal(axis, previous_x)


def _row(previous: Array, frame: Array, foot: Array) -> DhParameters:
    x_prev, z_prev, origin_prev = previous[:3, 0], previous[:3, 2], previous[:3, 3]
    x, z, origin = frame[:3, 0], frame[:3, 2], frame[:3, 3]
    return DhParameters(
        a_prev=float((foot - origin_prev) @ x_prev),
        alpha_prev=float(np.arctan2(np.cross(z_prev, z) @ x_prev, z_prev @ z)),
        d_offset=float((origin - foot) @ z),
        theta_offset=float(np.arctan2(np.cross(x_prev, x) @ z, x_prev @ x)),
    )
