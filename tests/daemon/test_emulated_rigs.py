"""Rigs of real drivers, calibrated end to end: their devices emulated by one process, served by another."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import httpx
import numpy as np
import pytest
from numpy.typing import NDArray

from daemon.profile import Profile, load_profile
from drivers.clock import SystemClock
from drivers.simulated import SimulatedWorld

PATIENCE: Final = 500.0
"""Seconds that a calibration may take: its devices move at the pace of life, on a machine with other work."""
POSES: Final = 20
POSITION, ROTATION = 3e-4, 5e-4
"""Metres and radians that a pose may be off."""

# Pictures are rendered and measured while the axes move: less often than the shipped profile's. Its target is one of
# disks here, whose claimed certainty holds to the limit of the picture.
BOARD = 'kind = "charuco"\nrows = 6\ncolumns = 8\n'
DISKS = 'kind = "circle_grid"\nrows = 6\ncolumns = 7\ndisk_diameter = "18 mm"\n'
CHANGES = {
    "grbl-table": (
        ('frame_rate = "10 Hz"', 'frame_rate = "5 Hz"'),
        (BOARD, DISKS),
        ('marker = "23 mm"\ndictionary = "DICT_5X5_100"\n', ""),
    )
}


@contextmanager
def running(*arguments: str, stdin: int = subprocess.DEVNULL) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run `activecam` in a process of its own; give it, and the first line that it prints."""
    command = [sys.executable, "-c", "from daemon.cli import main; main()", *arguments]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(command, stdin=stdin, stdout=subprocess.PIPE, text=True, env=environment)
    with process:
        try:
            assert process.stdout is not None
            yield process, process.stdout.readline()
        finally:
            process.terminate()


def rarer(name: str, folder: Path) -> Path:
    """Write a shipped profile with fewer frames a second."""
    text = files("hw_profiles").joinpath(f"{name}.toml").read_text(encoding="utf-8")
    for old, new in CHANGES[name]:
        assert old in text
        text = text.replace(old, new)
    path = folder / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    return path


def calibrate(http: httpx.Client) -> dict[str, Any]:
    """Run the profile's procedure to its end."""
    begun = http.post("/runs", json={"owner": "the tests"})
    assert begun.status_code == 202, begun.text
    deadline = time.monotonic() + PATIENCE
    while (run := http.get(f"/runs/{begun.json()['id']}").json())["state"] == "running":
        assert time.monotonic() < deadline, run
        time.sleep(0.5)
    return dict(run)


def some_readings(profile: Profile) -> NDArray[np.float64]:
    """Return readings (n, axes) within those of the procedure."""
    seen = np.array([list(view.readings.values()) for view in profile.procedure.planned_views()])
    return np.random.default_rng(5).uniform(seen.min(axis=0), seen.max(axis=0), (POSES, seen.shape[1]))


def true_poses(profile: Profile, readings: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the camera's true poses (n, 4, 4), as `activecam truth` prints them."""
    assert profile.simulation is not None
    specs = [axis.spec for axis in profile.axes]
    world = SimulatedWorld(profile.simulation, specs, profile.target.model_dump(), SystemClock())
    return np.array([world.world_from_camera(vector) for vector in readings])


@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", CHANGES)
def test_a_calibrated_rig_knows_where_its_camera_is_and_how_well(name: str, tmp_path: Path) -> None:
    given, served = rarer(name, tmp_path), tmp_path / "served.toml"
    with running("simulate", str(given), "-o", str(served), "--json") as (_, places):
        assert json.loads(places)["profile"] == str(served)
        data = str(tmp_path / "data")
        with running("serve", "--profile", str(served), "--data", data, "--port", "0") as (_, ready):
            address = ready.partition(" at ")[2].partition(" (")[0]
            with httpx.Client(base_url=address, timeout=60) as http:
                run = calibrate(http)
                assert run["state"] == "succeeded", run
                profile = load_profile(served)
                readings = some_readings(profile)
                answer = http.post("/pose", json={"readings": readings.tolist()}).json()
    found = np.array([pose["world_from_camera"] for pose in answer["poses"]])
    covariances = np.array([pose["covariance"] for pose in answer["poses"]])
    errors = np.linalg.inv(true_poses(profile, readings)) @ found
    position = np.linalg.norm(errors[:, :3, 3], axis=1)
    rotation = np.linalg.norm(errors[:, [2, 0, 1], [1, 2, 0]] - errors[:, [1, 2, 0], [2, 0, 1]], axis=1) / 2
    spread = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    assert position.max() < POSITION
    assert rotation.max() < ROTATION
    assert np.all(rotation < 3 * np.linalg.norm(spread[:, :3], axis=1))
    assert np.all(position < 3 * np.linalg.norm(spread[:, 3:], axis=1))
