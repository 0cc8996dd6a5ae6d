"""Random rigs that look at a chessboard, with image noise: what an estimator's efficiency is measured on.

Projection and motion are formulas of this file's and of `true_rig`'s own, not those of the code under test.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.true_rig import Array, Rig, unit
from calib.session import SESSION_FORMAT, Session

WIDTH, HEIGHT = 1280, 960
LENS = np.array([1500.0, 1500.0, 640.0, 480.0, -0.1, 0.05, 0.0, 0.0, 0.0])
"""fx fy cx cy (px), then OpenCV's k1 k2 p1 p2 k3."""
TARGET = {"kind": "chessboard", "rows": 6, "columns": 7, "pitch": 0.03}
POINTS = np.array([[column * 0.03, row * 0.03, 0.0] for row in range(6) for column in range(7)])
UNITS = {"revolute": "deg", "prismatic": "mm"}

VIEWS = 9
"""Of each joint."""


@dataclass(frozen=True, eq=False)
class LookingRig:
    """A rig with the sweeps (m, 2) of low and high readings that keep the board in the picture, and its lens."""

    rig: Rig
    ranges: Array
    lens: Array = field(default_factory=LENS.copy)

    def plan(self, views: int = VIEWS) -> list[tuple[int, Array]]:
        """Return (joint, readings) of each view: every joint alone over its range, the others at 0."""
        sweeps = [(joint, np.linspace(low, high, views)) for joint, (low, high) in enumerate(self.ranges)]
        return [
            (joint, value * np.eye(len(self.ranges))[joint]) for joint, sweep in sweeps for value in sweep
        ]

    def readings(self, rng: np.random.Generator, count: int) -> Array:
        """Return readings (count, m) anywhere inside the ranges."""
        return rng.uniform(*self.ranges.T, (count, len(self.ranges)))

    def pixels(self, readings: Array) -> Array:
        """Return where the board's corners are seen (n, points, 2) at readings (n, m)."""
        return self.seen_from(self.rig.poses(readings))

    def seen_from(self, poses: Array) -> Array:
        """Return where the camera sees the board's corners (n, points, 2) from poses (n, 4, 4)."""
        return project(poses, self.lens)


def project(poses: Array, lens: Array = LENS) -> Array:
    """Return where cameras at `poses` (..., 4, 4) see the board's corners (..., points, 2), nan for behind."""
    seen = (POINTS - poses[..., None, :3, 3]) @ poses[..., :3, :3]
    x, y = np.moveaxis(seen[..., :2] / np.where(seen[..., 2:] > 0, seen[..., 2:], np.nan), -1, 0)
    focal, centre, (k1, k2, p1, p2, k3) = lens[:2], lens[2:4], lens[4:]
    square = x**2 + y**2
    radial = 1 + k1 * square + k2 * square**2 + k3 * square**3
    bent_x = x * radial + 2 * p1 * x * y + p2 * (square + 2 * x**2)
    bent_y = y * radial + p1 * (square + 2 * y**2) + 2 * p2 * x * y
    pixels: Array = np.stack([bent_x, bent_y], axis=-1) * focal + centre
    return pixels


def in_picture(pose: Array) -> bool:
    """Return whether a camera at `pose` sees the whole board."""
    pixels = project(pose)
    return bool(np.isfinite(pixels).all() and (pixels > 5).all() and (pixels < [WIDTH - 5, HEIGHT - 5]).all())


def looking_rig(rng: np.random.Generator, joints: int) -> LookingRig:
    """Return a rig of so many random joints whose sweeps are worth something."""
    while True:
        kinds = [str(kind) for kind in rng.choice(["revolute", "prismatic"], joints, p=[0.7, 0.3])]
        mount = _looking_at_the_board(rng)
        rig = Rig(
            kinds=kinds,
            axes=np.array([unit(rng.normal(size=3)) for _ in kinds]),
            points=mount[:3, 3] + rng.uniform(-0.3, 0.3, (joints, 3)),
            scales=np.array([np.pi / 180 if kind == "revolute" else 1e-3 for kind in kinds])
            * rng.uniform(0.95, 1.05, joints),
            mount=mount,
        )
        ranges = np.array([[-_reach(rig, joint, -1), _reach(rig, joint, 1)] for joint in range(joints)])
        least = np.array([15 if kind == "revolute" else 80 for kind in kinds])
        if (np.ptp(ranges, axis=1) >= least).all():
            return LookingRig(rig, ranges)


def _looking_at_the_board(rng: np.random.Generator) -> Array:
    tilt, around = np.radians(rng.uniform(20, 35)), rng.uniform(0, 2 * np.pi)
    forward = np.array([np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), np.cos(tilt)])
    right = unit(np.cross([0, 1, 0], forward))
    upright = np.column_stack([right, np.cross(forward, right), forward])
    mount = np.eye(4)
    mount[:3, :3] = upright @ Rotation.from_rotvec([0, 0, rng.uniform(-0.4, 0.4)]).as_matrix()
    mount[:3, 3] = POINTS.mean(axis=0) - rng.uniform(0.5, 0.7) * forward
    return mount


def _reach(rig: Rig, joint: int, sign: int) -> float:
    """Return how far the joint can go before the board leaves the picture, in whole steps."""
    most = 60.0 if rig.kinds[joint] == "revolute" else 300.0
    steps = np.arange(1, 61) * most / 60
    for index, reading in enumerate(steps):
        if not in_picture(rig.pose(sign * reading * np.eye(len(rig.kinds))[joint])):
            return float(steps[index - 1]) if index else 0.0
    return most


def noisy_session(looking: LookingRig, rng: np.random.Generator, noise: float = 0.1, **keys: Any) -> Session:
    """Return a session of the rig's plan with `noise` px (std) on every coordinate."""
    plan = looking.plan()
    pixels = looking.pixels(np.array([at for _, at in plan]))
    seen = [view + noise * rng.normal(size=view.shape) for view in pixels]
    return session_of_views(looking, plan, seen, **keys)


def session_of_views(
    looking: LookingRig, plan: Iterable[tuple[int | None, Array]], pixels: Iterable[Array], **keys: Any
) -> Session:
    """Return a session whose views show the board at `pixels`, by (joint, readings) of each view in `plan`."""
    ids = list(range(len(POINTS)))
    views = [
        {
            "joint": None if joint is None else f"j{joint}",
            "readings": at.tolist(),
            "points": {"ids": ids, "pixels": seen.tolist()},
        }
        for (joint, at), seen in zip(plan, pixels, strict=True)
    ]
    return Session.model_validate(session_header(looking) | {"views": views} | keys)


def session_header(looking: LookingRig) -> dict[str, Any]:
    """Return all that a session of the rig says before its views."""
    return {
        "format": SESSION_FORMAT,
        "joints": [
            {"name": f"j{joint}", "kind": kind, "reading_unit": UNITS[kind]}
            for joint, kind in enumerate(looking.rig.kinds)
        ],
        "cameras": [{"name": "main", "width": WIDTH, "height": HEIGHT}],
        "target": TARGET,
    }
