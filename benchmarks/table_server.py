"""The server of `stop_under_load`, in a process of its own: `python -m benchmarks.table_server PROFILE`.

The daemon on that profile, with a calibration solved from the points that the camera would see.
"""

import asyncio
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.pose_server import store_calibration
from calib import Calibration, Session, solve
from calib.session import SESSION_FORMAT
from calib.targets import target_points
from daemon.profile import Profile, load_profile
from daemon.server import serve
from drivers.clock import SystemClock
from drivers.simulated.world import SimulatedWorld


def main(profile: Profile) -> None:
    """Serve until SIGTERM."""
    with TemporaryDirectory() as folder:
        asyncio.run(store_calibration(Path(folder), _calibration(profile)))
        serve(profile, Path(folder), port=0, on_ready=lambda address: print(address, flush=True))


def _calibration(profile: Profile) -> Calibration:
    assert profile.simulation is not None
    specs = [axis.spec for axis in profile.axes]
    world = SimulatedWorld(profile.simulation, specs, profile.target.model_dump(), SystemClock())
    points, rng = target_points(profile.target), np.random.default_rng(0)
    slide = [("slide", (float(v), turn)) for turn in (-9.0, 9.0) for v in np.linspace(10, 290, 6)]
    turn = [("turn", (150.0, float(v))) for v in np.linspace(-14, 14, 8)]
    views = []
    for joint, readings in slide + turn:
        seen = world.project(points, readings)
        pixels = seen + rng.normal(0, 0.05, seen.shape)
        shown = {"ids": list(range(len(points))), "pixels": pixels.tolist()}
        views.append({"joint": joint, "readings": list(readings), "points": shown})
    empty = profile.empty_session().model_dump(mode="json", exclude_unset=True)
    return solve(Session.model_validate(empty | {"format": SESSION_FORMAT, "complete": True, "views": views}))


if __name__ == "__main__":
    main(load_profile(Path(sys.argv[1])))
