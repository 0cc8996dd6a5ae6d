"""Sessions of target points seen by a simulated camera, by projection formulas of their own."""

from typing import Any

import numpy as np

from benchmarks.true_rig import Rig, unit
from calib.session import SESSION_FORMAT, Session

WIDTH, HEIGHT, FOCAL = 1280, 960, 1500.0


def two_axis_rig() -> Rig:
    """Return a slide and a pan that look at a plate of a few decimetres around the world's origin, tilted."""
    mount = look_at(np.array([0.1, -0.55, -1.1]), np.array([0.09, 0.07, 0.0]))
    return Rig(
        kinds=["prismatic", "revolute"],
        axes=np.array([unit(mount[:3, 0] + 0.05), unit(mount[:3, 1] + 0.02)]),
        points=np.array([[0.0, 0, 0], mount[:3, 3] - 0.08 * mount[:3, 2]]),
        scales=np.array([1e-3, np.pi / 180]),
        mount=mount,
    )


def look_at(position: np.ndarray, point: np.ndarray) -> np.ndarray:
    forward = unit(point - position)
    right = unit(np.cross(np.array([0, 1.0, 0]), forward))
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    pose[:3, 3] = position
    return pose


def project(points: np.ndarray, world_from_camera: np.ndarray) -> np.ndarray:
    seen = (points - world_from_camera[:3, 3]) @ world_from_camera[:3, :3]
    return FOCAL * seen[:, :2] / seen[:, 2:] + [WIDTH / 2, HEIGHT / 2]


def grid(rows: int, columns: int, pitch: float) -> np.ndarray:
    row, column = np.divmod(np.arange(rows * columns), columns)
    return np.column_stack([column * pitch, row * pitch, np.zeros(rows * columns)])


def plan(verify: bool = False) -> list[dict[str, Any]]:
    """Return 9 positions a joint, and as many between them to verify with."""
    shift = 0.37 if verify else 0.0
    use = {"use": "verify"} if verify else {}
    sweep = np.linspace(-1, 1, 9) * (1 - shift)
    return [{"joint": "slide", "readings": [100 * s, 0.0], **use} for s in sweep] + [
        {"joint": "pan", "readings": [10.0, 8 * s], **use} for s in sweep
    ]


def points_session(
    rig: Rig, views: list[dict[str, Any]], target: dict[str, Any], points: np.ndarray, **keys: Any
) -> Session:
    """Return a session in which each view carries the points of the target where the camera sees them."""
    seen = []
    for view in views:
        pixels = project(points, rig.pose(np.array(view["readings"])))
        assert (pixels > 0).all()
        assert (pixels < [WIDTH, HEIGHT]).all()
        seen.append({**view, "points": {"ids": list(range(len(points))), "pixels": pixels.tolist()}})
    return Session.model_validate(
        {
            "format": SESSION_FORMAT,
            "joints": [
                {"name": "slide", "kind": "prismatic", "reading_unit": "mm", "unit_trusted": True},
                {"name": "pan", "kind": "revolute", "reading_unit": "deg"},
            ],
            "cameras": [{"name": "main", "width": WIDTH, "height": HEIGHT}],
            "target": target,
            "views": seen,
        }
        | keys
    )


DISKS = {"kind": "circle_grid", "rows": 6, "columns": 7, "pitch": 0.03, "disk_diameter": 0.018}
DISK_CENTRES = grid(6, 7, 0.03)
