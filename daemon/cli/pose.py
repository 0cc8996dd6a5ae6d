"""`activecam pose`: the camera's pose at given readings."""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from calib import load_calibration
from calib.documents import read_json
from calib.errors import ReadingsError
from daemon.cli.console import warn

Readings = Annotated[
    list[float] | None, typer.Option("--readings", help="One number a joint, in its reading unit.")
]
Approached = Annotated[
    list[int] | None,
    typer.Option(
        "--approached",
        min=-1,
        max=1,
        help="From which side each joint came: 1 from below, -1 from above, 0 if unknown.",
    ),
]
ReadingsFile = Annotated[Path | None, typer.Option("--readings-file", help="A JSON list of such lists.")]


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog="Example: activecam pose calibration.json --readings 12.5 30")(pose)


def pose(
    calibration: Annotated[Path, typer.Argument(help="A calibration file.")],
    readings: Readings = None,
    readings_file: ReadingsFile = None,
    approached: Approached = None,
    camera: Annotated[str | None, typer.Option(help="Which camera, the first by default.")] = None,
) -> None:
    """Print the camera's pose at given readings as JSON: metres, row-major 4 x 4 matrices."""
    loaded = load_calibration(calibration)
    wanted = wanted_readings(readings, readings_file, [joint.name for joint in loaded.joints])
    for names in {tuple(loaded.out_of_range(one)) for one in wanted}:
        if names:
            warn(f"beyond the readings seen in calibration: {', '.join(names)}")
    poses = loaded.world_from_camera(wanted, camera, approached)
    covariances = loaded.pose_covariance(wanted, camera, approached)
    print_poses(wanted, poses, loaded.base_from_world(), covariances)


def wanted_readings(readings: list[float] | None, file: Path | None, joints: list[str]) -> list[list[float]]:
    """Return the readings asked for on the command line, one vector each; raises ReadingsError."""
    if (readings is None) == (file is None):
        raise ReadingsError(
            f"give either --readings (one number each for {', '.join(joints)}) or --readings-file"
        )
    vectors = [readings] if file is None else read_json(file)
    if not isinstance(vectors, list) or not all(isinstance(vector, list) for vector in vectors):
        raise ReadingsError(f"{file}: must be a JSON list of lists of readings, such as [[12.5, 30]]")
    if not vectors:
        raise ReadingsError(f"{file}: has no readings in it; give lists such as [[12.5, 30]]")
    for vector in vectors:
        numbers = all(isinstance(value, int | float) and abs(value) <= sys.float_info.max for value in vector)
        if len(vector) != len(joints) or not numbers:
            raise ReadingsError(
                f"readings {vector} are not one finite number for each of the {len(joints)} joints "
                f"({', '.join(joints)})"
            )
    return [[float(value) for value in vector] for vector in vectors]


def print_poses(
    readings: list[list[float]],
    poses: NDArray[np.float64],
    base_from_world: NDArray[np.float64] | None,
    covariances: NDArray[np.float64] | None,
) -> None:
    """Print poses (n, 4, 4), with their covariances (n, 6, 6) where known, as the command line's JSON document."""
    deviations = None if covariances is None else np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    entries: list[dict[str, Any]] = [
        {
            "readings": vector,
            "world_from_camera": pose.tolist(),
            "base_from_camera": None if base_from_world is None else (base_from_world @ pose).tolist(),
            "std": {
                "rotation_rad": None if deviations is None else deviations[index, :3].tolist(),
                "position_m": None if deviations is None else deviations[index, 3:].tolist(),
            },
        }
        for index, (vector, pose) in enumerate(zip(readings, poses, strict=True))
    ]
    typer.echo(json.dumps({"poses": entries}))
