"""The paper's positioning table as the shipped profile simulates it, without its devices."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib import Session
from calib.session import SESSION_FORMAT
from calib.targets import Target, target_points
from daemon.profile import Profile, load_profile
from drivers.clock import SystemClock
from drivers.simulated.world import SimulatedWorld

SLIDE_MM = (-30.0, 1030.0)
PAN_DEG = (-31.0, 31.0)
NEAR_MM = 1000.0
"""Where the slide stands while the pan turns, as in the profile's procedure."""


def paper_profile() -> Profile:
    """Return the shipped profile `paper-table`."""
    return load_profile("paper-table")


def paper_world(profile: Profile) -> SimulatedWorld:
    """Return the world in which the profile's devices would move."""
    assert profile.simulation is not None
    specs = [axis.spec for axis in profile.axes]
    return SimulatedWorld(profile.simulation, specs, profile.target.model_dump(), SystemClock())


def swept_readings(views: int) -> list[tuple[str, tuple[float, float]]]:
    """Return the joint exercised and the readings (mm, deg) of views shared out over both joints."""
    straight = views // 2
    slide = [("slide", (float(v), 0.0)) for v in np.linspace(*SLIDE_MM, straight)]
    return slide + [("pan", (NEAR_MM, float(v))) for v in np.linspace(*PAN_DEG, views - straight)]


def session_of_points(views: int, noise_px: float, seed: int = 0, target: Target | None = None) -> Session:
    """Return a session whose views carry all points of `target`, each pixel off by `noise_px` (std).

    It is the profile's target with its 42 points unless another is given, which is to be no larger.
    """
    profile = paper_profile()
    world, target = paper_world(profile), target or profile.target
    points, rng = target_points(target), np.random.default_rng(seed)
    empty = profile.empty_session().model_dump(mode="json", exclude_unset=True)
    empty["target"] = target.model_dump(mode="json")
    taken = []
    for joint, readings in swept_readings(views):
        seen = world.project(points, readings)
        taken.append(_view(joint, readings, seen + rng.normal(0, noise_px, seen.shape)))
    return Session.model_validate(empty | {"format": SESSION_FORMAT, "complete": True, "views": taken})


def _view(joint: str, readings: tuple[float, float], pixels: NDArray[np.float64]) -> Mapping[str, Any]:
    points = {"ids": list(range(len(pixels))), "pixels": pixels.tolist()}
    return {"joint": joint, "readings": list(readings), "points": points}
