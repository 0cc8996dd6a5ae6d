"""The paper's experiment on its simulated table: the daemon's whole procedure, in this process."""

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper_rig import paper_profile, paper_world
from calib import Calibration, Verification, load_session, solve, verify
from calib.document import Method
from daemon.procedure.events import Finished
from daemon.profile import Profile
from daemon.service import running_service

Array = NDArray[np.float64]

PLACES = 200
"""Readings, anywhere in the calibrated range, at which the camera is compared with the truth."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """What one run has found, and how far the camera is from its true pose: mean and largest (m, rad)."""

    seed: int
    calibration: Calibration
    verification: Verification
    position: tuple[float, float]
    rotation: tuple[float, float]


METHODS: tuple[Method, ...] = ("closed_form", "ml")


async def experiment(seed: int, *, thin: int = 1) -> dict[Method, Experiment]:
    """Take one run's views with the noise of `seed`, and solve and verify them by each method.

    Of each sweep only every `thin`-th position is taken. Raises RuntimeError where the run does not succeed.
    """
    profile = _thinned(_seeded(paper_profile(), seed), thin)
    found: dict[Method, Experiment] = {}
    with TemporaryDirectory() as folder:
        async with running_service(profile, Path(folder)) as service:
            run = await service.runs.start(owner="benchmark")
            async for event in service.runs.events(run.id):
                if isinstance(event, Finished) and event.error is not None:
                    raise RuntimeError(f"the run with seed {seed} did not succeed: {event.error}")
            session = load_session(service.store.session_folder(run))
            for method in METHODS:
                calibration = solve(session, method)
                verified = verify(calibration, session)
                found[method] = Experiment(seed, calibration, verified, *_against_truth(profile, calibration))
    return found


def _seeded(profile: Profile, seed: int) -> Profile:
    assert profile.simulation is not None
    return replace(profile, simulation=profile.simulation.model_copy(update={"seed": seed}))


def _thinned(profile: Profile, thin: int) -> Profile:
    sweeps = tuple(replace(sweep, readings=sweep.readings[::thin]) for sweep in profile.procedure.sweeps)
    return replace(profile, procedure=replace(profile.procedure, sweeps=sweeps))


def _against_truth(
    profile: Profile, calibration: Calibration
) -> tuple[tuple[float, float], tuple[float, float]]:
    world = paper_world(profile)
    low, high = np.array(calibration.range).T
    readings = np.random.default_rng(0).uniform(low, high, (PLACES, len(low)))
    true = np.array([world.world_from_camera(vector) for vector in readings])
    found = calibration.world_from_camera(readings)
    distance = np.linalg.norm(found[:, :3, 3] - true[:, :3, 3], axis=1)
    # The sine of half the angle keeps its digits where the angle is small, and the trace does not.
    chord = np.linalg.norm(found[:, :3, :3] - true[:, :3, :3], axis=(1, 2))
    angle = 2 * np.arcsin(np.minimum(chord / np.sqrt(8), 1))
    return (float(distance.mean()), float(distance.max())), (float(angle.mean()), float(angle.max()))
