"""A calibration of a simulated rig without a run: solved from the points that its camera would see."""

from typing import Any

import numpy as np

from calib import Calibration, Session, solve
from calib.session import SESSION_FORMAT
from calib.targets import target_points
from daemon.profile import Profile
from daemon.service import Service
from drivers.simulated.world import SimulatedWorld

NOISE_PX = 0.05


def calibration_of(profile: Profile, world: SimulatedWorld) -> Calibration:
    points, rng = target_points(profile.target), np.random.default_rng(0)
    views = []
    for joint, readings in _swept(profile):
        pixels = world.project(points, readings)
        seen = {
            "ids": list(range(len(points))),
            "pixels": (pixels + rng.normal(0, NOISE_PX, pixels.shape)).tolist(),
        }
        views.append({"joint": joint, "readings": readings, "points": seen})
    empty = profile.empty_session().model_dump(mode="json", exclude_unset=True)
    return solve(Session.model_validate(empty | {"format": SESSION_FORMAT, "complete": True, "views": views}))


def calibrate(service: Service) -> Calibration:
    """Let `service` answer from a calibration of its simulated rig."""
    assert service.rig.world is not None
    calibration = calibration_of(service.profile, service.rig.world)
    service.poses.activate(service.poses.prepare("of points", calibration))
    return calibration


def _swept(profile: Profile) -> list[tuple[str, list[float]]]:
    """Each sweep of the small rig, with the slide amid its travel while the pan turns."""
    slide: list[Any] = [("slide", [v, 0.0]) for v in np.linspace(0, 100, 5).tolist()]
    return slide + [("pan", [50.0, v]) for v in np.linspace(-12, 12, 5).tolist()]
