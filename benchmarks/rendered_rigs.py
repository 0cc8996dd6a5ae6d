"""Random rigs as the simulated drivers render them: pictures of printed disks, with blur and noise."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.paper_rig import paper_profile
from benchmarks.random_rigs import HEIGHT, UNITS, WIDTH, LookingRig, looking_rig, session_header
from benchmarks.true_rig import Array
from calib import Session
from drivers.axis import AxisSpec
from drivers.clock import SystemClock
from drivers.simulated.exposure import Exposure
from drivers.simulated.options import SimulationOptions
from drivers.simulated.world import SimulatedWorld

PLATE = {"kind": "circle_grid", "rows": 6, "columns": 7, "pitch": 0.03, "disk_diameter": 0.018}
"""Its centres are where the board's corners are that `random_rigs` keep in the picture."""
SHARES = (0.9, 0.8, 0.7, 0.6)
"""Of a rig's sweeps, the largest that keeps the paper around the disks in the picture as well."""
MARGIN = 10.0
"""Pixels around the paper."""


def rendered_rig(rng: np.random.Generator, joints: int) -> tuple[LookingRig, SimulatedWorld]:
    """Return a random rig with its sweeps, and the world of the drivers in which it is rendered."""
    while True:
        whole = looking_rig(rng, joints)
        world = _world(whole)
        for share in SHARES:
            looking = replace(whole, ranges=share * whole.ranges)
            if all(in_picture(world, readings) for _, readings in looking.plan()):
                return looking, world


def in_picture(world: SimulatedWorld, readings: Array) -> bool:
    """Return whether the whole sheet is in the picture."""
    seen = world.project(world.plate.outline(), readings)
    return bool(((seen > MARGIN) & (seen < np.array([WIDTH, HEIGHT]) - 1 - MARGIN)).all())


def readings_in_picture(
    looking: LookingRig, world: SimulatedWorld, rng: np.random.Generator, count: int
) -> Array:
    """Return readings (count, m) anywhere inside the sweeps, from which the whole sheet is in the picture."""
    found: list[Array] = []
    while len(found) < count:
        found += [readings for readings in looking.readings(rng, count) if in_picture(world, readings)]
    return np.array(found[:count])


def rendered_session(
    looking: LookingRig,
    world: SimulatedWorld,
    held_out: Array,
    folder: Path,
    rng: np.random.Generator,
) -> Session:
    """Return a session in `folder` of the rig's plan, and of readings to be held out, with a picture each."""
    exposure = Exposure(world, WIDTH, HEIGHT)
    plan = [(f"j{joint}", "fit", readings) for joint, readings in looking.plan()]
    views = []
    for joint, use, readings in [*plan, *((None, "verify", readings) for readings in held_out)]:
        name = f"{len(views):04d}.png"
        picture = exposure.picture([world.world_from_camera(readings)], rng)
        cv2.imwrite(str(folder / name), picture)
        views.append({"joint": joint, "use": use, "readings": readings.tolist(), "image": name})
    # The plate looks the same upside down: the truth's way round is the session's.
    first = plan[0][2]
    origin = {
        "camera": "main",
        "readings": first.tolist(),
        "pixel": world.project(world.target_points()[:1], first)[0].tolist(),
    }
    header = session_header(looking) | {"target": PLATE, "origin": origin}
    return Session.model_validate(header | {"views": views}).at(folder)


def _world(looking: LookingRig) -> SimulatedWorld:
    """Return the rig in the words of the simulated drivers, with the pictures of the paper's table."""
    rig, paper = looking.rig, paper_profile().simulation
    assert paper is not None
    joints = [
        {"axis": axis.tolist(), "point": _lengths(point), "scale": float(scale)}
        for axis, point, scale in zip(rig.axes, rig.points, rig.scales, strict=True)
    ]
    turn = Rotation.from_matrix(rig.mount[:3, :3]).as_rotvec()
    fx, fy, cx, cy = (f"{value!r} px" for value in looking.lens[:4].tolist())
    camera = {
        "position": _lengths(rig.mount[:3, 3]),
        "rotation": [f"{value!r} rad" for value in turn.tolist()],
        "lens": {"fx": fx, "fy": fy, "cx": cx, "cy": cy, "distortion": looking.lens[4:].tolist()},
        "picture": paper.camera.picture,
    }
    specs = [
        AxisSpec(f"j{joint}", kind, UNITS[kind], tuple(ends), 1.0, 1.0, 1.0)
        for joint, (kind, ends) in enumerate(zip(rig.kinds, looking.ranges.tolist(), strict=True))
    ]
    options = SimulationOptions.model_validate({"joints": joints, "camera": camera})
    return SimulatedWorld(options, specs, PLATE, SystemClock())


def _lengths(point: Array) -> list[str]:
    return [f"{value!r} m" for value in point.tolist()]
