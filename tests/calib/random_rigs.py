"""Random rigs that look at a chessboard, with image noise: what an estimator's efficiency is measured on."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from calib.session import SESSION_FORMAT, Session
from tests.calib.rigs import Rig, unit
from tests.calib.scenes import grid

WIDTH, HEIGHT = 1280, 960
FOCAL, CENTRE, BEND = 1500.0, (640.0, 480.0), (-0.1, 0.05)
TARGET = {"kind": "chessboard", "rows": 6, "columns": 7, "pitch": 0.03}
POINTS = grid(6, 7, 0.03)


@dataclass(frozen=True)
class LookingRig:
    """A rig with the sweeps (low, high) that keep the board in the picture."""

    rig: Rig
    ranges: np.ndarray

    def plan(self, views: int = 9) -> list[tuple[int, np.ndarray]]:
        """Return (joint, readings) of each view: every joint alone over its range, the others at 0."""
        sweeps = [(joint, np.linspace(low, high, views)) for joint, (low, high) in enumerate(self.ranges)]
        return [
            (joint, value * np.eye(len(self.ranges))[joint]) for joint, sweep in sweeps for value in sweep
        ]

    def readings(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Return readings (count, m) anywhere inside the ranges."""
        return rng.uniform(*self.ranges.T, (count, len(self.ranges)))

    def poses(self, readings: np.ndarray) -> np.ndarray:
        return np.array([self.rig.pose(at) for at in readings])


def project(pose: np.ndarray) -> np.ndarray:
    """Return where a camera at `pose` sees the board's corners (n, 2), by formulas of this file's own."""
    seen = (POINTS - pose[:3, 3]) @ pose[:3, :3]
    flat = seen[:, :2] / np.where(seen[:, 2:] > 0, seen[:, 2:], np.nan)
    square = (flat**2).sum(axis=1, keepdims=True)
    return FOCAL * flat * (1 + BEND[0] * square + BEND[1] * square**2) + CENTRE


def in_picture(pose: np.ndarray) -> bool:
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


def _looking_at_the_board(rng: np.random.Generator) -> np.ndarray:
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
    """Return a session of the rig's plan with `noise` px on every coordinate."""
    views = [
        {
            "joint": f"j{joint}",
            "readings": at.tolist(),
            "points": {
                "ids": list(range(len(POINTS))),
                "pixels": (
                    project(looking.rig.pose(at)) + noise * rng.normal(size=(len(POINTS), 2))
                ).tolist(),
            },
        }
        for joint, at in looking.plan()
    ]
    units = {"revolute": "deg", "prismatic": "mm"}
    joints = [
        {"name": f"j{i}", "kind": kind, "reading_unit": units[kind]}
        for i, kind in enumerate(looking.rig.kinds)
    ]
    return Session.model_validate(
        {
            "format": SESSION_FORMAT,
            "joints": joints,
            "cameras": [{"name": "main", "width": WIDTH, "height": HEIGHT}],
            "target": TARGET,
            "views": views,
        }
        | keys
    )
