"""Rigs with known truth, of any arrangement of axes, and sessions of their exact poses."""

from typing import Any

import numpy as np
from hypothesis import strategies as st
from scipy.linalg import expm

from benchmarks.true_rig import Rig, unit
from calib.session import SESSION_FORMAT, Session

ARRANGEMENTS = ["skew", "intersecting", "parallel", "coaxial", "square"]


def random_rig(rng: np.random.Generator, kinds: list[str], arrangements: list[str]) -> Rig:
    """Return a rig whose neighbouring axes stand to each other as `arrangements` say."""
    axes, points = [unit(rng.normal(size=3))], [rng.uniform(-0.5, 0.5, 3)]
    for arrangement in arrangements[: len(kinds) - 1]:
        axis, point = axes[-1], points[-1] + rng.uniform(-0.3, 0.3) * axes[-1]
        across = unit(np.cross(axis, rng.normal(size=3)))
        match arrangement:
            case "skew":
                axes.append(unit(rng.normal(size=3)))
                points.append(point + rng.uniform(-0.3, 0.3, 3))
            case "intersecting":
                axes.append(unit(rng.normal(size=3)))
                points.append(point)
            case "parallel":
                axes.append(axis * rng.choice([-1, 1]))
                points.append(point + rng.uniform(0.05, 0.4) * across)
            case "coaxial":
                axes.append(axis * rng.choice([-1, 1]))
                points.append(point)
            case _:
                axes.append(across)
                points.append(point + rng.uniform(-0.3, 0.3) * np.cross(axis, across))
    mount = np.eye(4)
    mount[:3, :3] = expm(np.cross(np.eye(3), rng.normal(size=3)))
    mount[:3, 3] = rng.uniform(-1, 1, 3)
    scales = np.array([10 ** rng.uniform(-4, 0) for _ in kinds])
    return Rig(kinds, np.array(axes), np.array(points), scales, mount)


def sweep_session(
    rig: Rig, rng: np.random.Generator, order: list[int], turns: float = 0.4, views: int = 7
) -> Session:
    """Return a session of exact poses: each joint swept alone from a start of its own, in the given order."""
    readings: list[tuple[str, np.ndarray]] = []
    span = np.where([kind == "revolute" for kind in rig.kinds], 2 * np.pi * turns, 0.6) / rig.scales
    for joint in order:
        start = rng.uniform(-0.5, 0.5, len(rig.kinds)) * np.minimum(span, 2 / rig.scales)
        steps = max(views, int(np.ceil(span[joint] * rig.scales[joint] / 2.5)) + 1)
        for value in rng.permutation(np.linspace(-0.5, 0.5, steps)) * span[joint] + start[joint]:
            at = start.copy()
            at[joint] = value
            readings.append((f"j{joint}", at))
    return pose_session(rig, readings)


def pose_session(rig: Rig, readings: list[tuple[str, np.ndarray]], **keys: Any) -> Session:
    return Session.model_validate(
        {
            "format": SESSION_FORMAT,
            "joints": [
                {"name": f"j{i}", "kind": kind, "reading_unit": "counts"} for i, kind in enumerate(rig.kinds)
            ],
            "cameras": [{"name": "main"}],
            "target": {"kind": "none"},
            "views": [
                {"joint": joint, "readings": at.tolist(), "world_from_camera": rig.pose(at).tolist()}
                for joint, at in readings
            ],
        }
        | keys
    )


@st.composite
def rigs(draw: st.DrawFn, joints: tuple[int, int] = (1, 6)) -> tuple[Rig, np.random.Generator]:
    """Draw a rig of any mix of joints and arrangements, and the generator to take its readings from."""
    count = draw(st.integers(*joints))
    kinds = draw(st.lists(st.sampled_from(["revolute", "prismatic"]), min_size=count, max_size=count))
    arrangements = draw(st.lists(st.sampled_from(ARRANGEMENTS), min_size=count - 1, max_size=count - 1))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return random_rig(rng, kinds, arrangements), rng
