"""`activecam truth`: where a simulated rig's camera really is."""

from typing import Annotated

import numpy as np
import typer

from daemon.cli.pose import Readings, ReadingsFile, print_poses, wanted_readings
from daemon.profile import ProfileError, load_profile
from daemon.rig.devices import make_devices


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
    # The base is a frame of the calibration's own choosing: the world itself has none.
    print_poses(wanted, poses, None, None)
