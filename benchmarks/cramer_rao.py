"""The Cramer-Rao bound of a camera's pose: no unbiased estimate scatters less, whatever its method.

By central differences of the simulator's own pixels and poses, so that it shares nothing with a solver.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation

from benchmarks.random_rigs import LookingRig
from benchmarks.true_rig import Array, unit

STEP = 1e-5
"""Of a direction (rad), a point (m) or a distortion; of a scale, and of the lens's pixels, relative to them."""


def pose_bound(looking: LookingRig, readings: Array, noise: float) -> Array:
    """Return the least covariances (n, 6, 6) of the poses at `readings` (n, m), from the rig's plan of views.

    `noise` is the image points' (px, std of each coordinate), and nothing but the board is known beforehand. They are
    of the twist, rotation (rad) then position (m), from the true pose in the camera's frame.
    """
    views, true = np.array([at for _, at in looking.plan()]), looking.rig.poses(readings)
    pixels = _by_truth(looking, lambda rig: rig.pixels(views)).reshape(-1, _truths(looking))
    twists = _by_truth(looking, lambda rig: twists_between(true, rig.rig.poses(readings)))
    # The information is R^T R: its inverse's root keeps the digits that a product with itself would lose.
    root = noise * twists @ np.linalg.inv(np.linalg.qr(pixels).R)
    return root @ np.swapaxes(root, 1, 2)


def twists_between(poses: Array, others: Array) -> Array:
    """Return the twists (n, 6) from `poses` (n, 4, 4), in their frames, to `others`: rotation (rad), position (m)."""
    away = np.linalg.inv(poses) @ others
    return np.concatenate([Rotation.from_matrix(away[:, :3, :3]).as_rotvec(), away[:, :3, 3]], axis=1)


def _by_truth(looking: LookingRig, measured: Callable[[LookingRig], Array]) -> Array:
    """Return the derivatives (..., p) of what is measured on a rig by the p numbers of its truth."""
    steps = STEP * np.eye(_truths(looking))
    slopes = [measured(_moved(looking, step)) - measured(_moved(looking, -step)) for step in steps]
    return np.stack(slopes, axis=-1) / (2 * STEP)


def _truths(looking: LookingRig) -> int:
    """Return how many numbers the truth has: 5 a revolute joint, 3 a prismatic one, 6 of the mount, 9 of the lens."""
    return sum(5 if kind == "revolute" else 3 for kind in looking.rig.kinds) + 6 + 9


def _moved(looking: LookingRig, steps: Array) -> LookingRig:
    """Return the rig with its truth moved by `steps` (p,), none of which leaves all pixels as they are.

    An axis moves across itself only: neither its length nor where along it its point lies is anything real.
    """
    rig = looking.rig
    axes, points, scales, mount = rig.axes.copy(), rig.points.copy(), rig.scales.copy(), rig.mount.copy()
    for joint, kind in enumerate(rig.kinds):
        across = null_space(rig.axes[joint, None])
        scales[joint] *= 1 + steps[0]
        axes[joint] = unit(axes[joint] + across @ steps[1:3])
        if kind == "revolute":
            points[joint] += across @ steps[3:5]
        steps = steps[5 if kind == "revolute" else 3 :]
    mount[:3, :3] = mount[:3, :3] @ Rotation.from_rotvec(steps[:3]).as_matrix()
    mount[:3, 3] += steps[3:6]
    lens = looking.lens + steps[6:] * np.append(looking.lens[:4], np.ones(5))
    moved = replace(rig, axes=axes, points=points, scales=scales, mount=mount)
    return replace(looking, rig=moved, lens=lens)
