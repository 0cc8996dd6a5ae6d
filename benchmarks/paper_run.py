"""The paper's experiment on its simulated table: the daemon's whole procedure, in this process."""

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper_rig import paper_profile, paper_world
from calib import Calibration, Session, Verification, load_session, solve, verify
from calib.document import Method
from daemon.procedure.events import Finished
from daemon.profile import Profile
from daemon.service import running_service
from drivers.simulated.world import SimulatedWorld

Array = NDArray[np.float64]

PLACES = 200
"""Readings, anywhere in the calibrated range, at which the camera is compared with the truth."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """What one run has found, and what no experiment on a real table can tell: how far it is from the truth.

    `position` (m) and `rotation` (rad) are mean and largest over places anywhere in the calibrated range, `points` the
    median error (px) of image points at the held-out positions, `scales` each joint's relative error.
    """

    seed: int
    calibration: Calibration
    verification: Verification
    position: tuple[float, float]
    rotation: tuple[float, float]
    points: float
    scales: tuple[float, ...]


METHODS: tuple[Method, ...] = ("ml", "closed_form")


async def experiment(seed: int, *, thin: int = 1) -> dict[Method, Experiment]:
    """Take one run's views with the noise of `seed`, and solve and verify them by each method.

    Of each sweep only every `thin`-th position is taken. Raises RuntimeError where the run does not succeed.
    """
    profile = _thinned(_seeded(paper_profile(), seed), thin)
    with TemporaryDirectory() as folder:
        async with running_service(profile, Path(folder)) as service:
            run = await service.runs.start(owner="benchmark")
            async for event in service.runs.events(run.id):
                if isinstance(event, Finished) and event.error is not None:
                    raise RuntimeError(f"the run with seed {seed} did not succeed: {event.error}")
            session = load_session(service.store.session_folder(run))
            return {method: _judged(profile, session, method, seed) for method in METHODS}


def _judged(profile: Profile, session: Session, method: Method, seed: int) -> Experiment:
    calibration = solve(session, method)
    world = paper_world(profile)
    position, rotation = _pose_errors(world, calibration)
    return Experiment(
        seed=seed,
        calibration=calibration,
        verification=verify(calibration, session),
        position=position,
        rotation=rotation,
        points=_point_error(profile, world, calibration),
        scales=tuple(
            abs(found.scale / true.scale - 1)
            for found, true in zip(calibration.joints, world.options.joints, strict=True)
        ),
    )


def _seeded(profile: Profile, seed: int) -> Profile:
    assert profile.simulation is not None
    return replace(profile, simulation=profile.simulation.model_copy(update={"seed": seed}))


def _thinned(profile: Profile, thin: int) -> Profile:
    sweeps = tuple(replace(sweep, readings=sweep.readings[::thin]) for sweep in profile.procedure.sweeps)
    return replace(profile, procedure=replace(profile.procedure, sweeps=sweeps))


def _pose_errors(
    world: SimulatedWorld, calibration: Calibration
) -> tuple[tuple[float, float], tuple[float, float]]:
    low, high = np.array(calibration.range).T
    readings = np.random.default_rng(0).uniform(low, high, (PLACES, len(low)))
    true = np.array([world.world_from_camera(vector) for vector in readings])
    found = calibration.world_from_camera(readings)
    distance = np.linalg.norm(found[:, :3, 3] - true[:, :3, 3], axis=1)
    # The sine of half the angle keeps its digits where the angle is small, and the trace does not.
    chord = np.linalg.norm(found[:, :3, :3] - true[:, :3, :3], axis=(1, 2))
    angle = 2 * np.arcsin(np.minimum(chord / np.sqrt(8), 1))
    return (float(distance.mean()), float(distance.max())), (float(angle.mean()), float(angle.max()))


def _point_error(profile: Profile, world: SimulatedWorld, calibration: Calibration) -> float:
    planned = [view for view in profile.procedure.planned_views() if view.use == "verify"]
    readings, points = np.array([list(view.readings.values()) for view in planned]), world.target_points()
    true = np.array([world.project(points, vector) for vector in readings])
    away = calibration.project(points, readings) - true
    return float(np.median(np.linalg.norm(away, axis=-1)))
