"""`activecam truth`: where a simulated rig's camera really is."""

from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from calib.session import SESSION_FORMAT, Session
from daemon.cli.pose import Readings, ReadingsFile, print_poses, wanted_readings
from daemon.profile import Profile, ProfileError, load_profile
from daemon.rig import make_devices
from drivers.simulated import SimulatedWorld

POSITIONS = 9
"""Positions of each axis from which the true base is read."""


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog="Example: activecam truth paper-table --readings 500 10")(truth)


def truth(
    profile: Annotated[
        str, typer.Argument(help="A simulated rig's profile: a file, or a shipped one's name.")
    ],
    readings: Readings = None,
    readings_file: ReadingsFile = None,
) -> None:
    """Print a simulated rig's true camera pose, in the form of `activecam pose`: to judge with."""
    loaded = load_profile(profile)
    world = make_devices(loaded).world
    if world is None:
        raise ProfileError([f"{profile}: is not a simulated rig, and nobody knows the truth of a real one"])
    wanted = wanted_readings(readings, readings_file, [axis.spec.name for axis in loaded.axes])
    poses = np.array([world.world_from_camera(vector) for vector in wanted])
    print_poses(wanted, poses, _base_from_world(loaded, world), None)


def _base_from_world(profile: Profile, world: SimulatedWorld) -> NDArray[np.float64] | None:
    """Return the true base's inverse (4, 4), None where the camera does not ride on the last axis.

    The world knows axes and no base: what frame that is, the solver says, and from exact poses exactly.
    """
    from calib import solve

    if profile.camera.link not in (None, profile.axes[-1].spec.name):
        return None
    specs = [axis.spec for axis in profile.axes]
    middle = np.array([np.mean(spec.limits) for spec in specs])
    views: list[dict[str, Any]] = []
    for index, spec in enumerate(specs):
        for value in np.linspace(*spec.limits, POSITIONS):
            at = np.where(np.arange(len(specs)) == index, value, middle)
            pose = world.world_from_camera(at).tolist()
            views.append({"joint": spec.name, "readings": at.tolist(), "world_from_camera": pose})
    session = Session.model_validate(
        {
            "format": SESSION_FORMAT,
            "joints": [{"name": spec.name, "kind": spec.kind, "reading_unit": "-"} for spec in specs],
            "cameras": [{"name": profile.camera.spec.name}],
            "target": {"kind": "none"},
            "views": views,
        }
    )
    return solve(session, "closed_form").base_from_world()
