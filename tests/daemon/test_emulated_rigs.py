"""Rigs of real drivers, calibrated end to end: their devices emulated by one process, served by another."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
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
HELD_UP: Final = "sent nothing for"
"""What a run says whose pictures came later than the profile states."""
POSES: Final = 20
POSITION, ROTATION = 3e-4, 5e-4
"""Metres and radians that a pose may be off."""

# Of what a rig takes its time for there is less. Pictures, which are rendered while axes move, are fewer and smaller,
# but of a larger board, and need no more than one rendering each; axes are faster, stand sooner, and are asked more
# often; some views are left out.
PATIENT = ("[procedure]", '[procedure]\nframe_timeout = "60 s"')
FEWER_PICTURES = ('frame_rate = "10 Hz"', 'frame_rate = "5 Hz"')
CHANGES = {
    "grbl-table": (
        PATIENT,
        FEWER_PICTURES,
        ('exposure = "8 ms"', 'exposure = "0.01 ms"'),
        ("baud_rate = 115200", 'baud_rate = 115200\nreport_interval = "20 ms"'),
        ("width = 960", "width = 640"),
        ("height = 720", "height = 480"),
        ('fx = "905 px"', 'fx = "603 px"'),
        ('fy = "903 px"', 'fy = "602 px"'),
        ('cx = "487 px"', 'cx = "324.7 px"'),
        ('cy = "352 px"', 'cy = "234.7 px"'),
        ('pitch = "30 mm"', 'pitch = "36 mm"'),
        ('marker = "23 mm"', 'marker = "27.6 mm"'),
        ('velocity = "60 mm/s"', 'velocity = "300 mm/s"'),
        ('acceleration = "400 mm/s2"', 'acceleration = "3000 mm/s2"'),
        ('velocity = "30 deg/s"', 'velocity = "60 deg/s"'),
        ('acceleration = "200 deg/s2"', 'acceleration = "600 deg/s2"'),
        ('settle = "500 ms"', 'settle = "200 ms"'),
        ("positions = 6", "positions = 4"),
        ("positions = 11", "positions = 7"),
    ),
    "cia402-pan-tilt": (
        PATIENT,
        FEWER_PICTURES,
        ('exposure = "10 ms"', 'exposure = "0.01 ms"'),
        ("noise = 1.5", "noise = 0.75"),
        ("width = 1280", "width = 800"),
        ("height = 720", "height = 450"),
        ('fx = "1204 px"', 'fx = "752 px"'),
        ('fy = "1203 px"', 'fy = "751 px"'),
        ('cx = "634.2 px"', 'cx = "396.4 px"'),
        ('cy = "367.9 px"', 'cy = "229.9 px"'),
        ('pitch = "24 mm"', 'pitch = "36 mm"'),
        ('marker = "18 mm"', 'marker = "27 mm"'),
        ('look_at = ["96 mm", "69 mm", "0 mm"]', 'look_at = ["144 mm", "100 mm", "0 mm"]'),
        ('velocity = "30 deg/s"', 'velocity = "60 deg/s"'),
        ('acceleration = "120 deg/s2"', 'acceleration = "400 deg/s2"'),
        ('settle = "1 s"', 'settle = "300 ms"'),
        ("damping = 0.12", "damping = 0.4"),
        ("positions = 11", "positions = 6"),
        ('["-13 deg", "-7 deg", "-0.6 deg", "5.5 deg", "11.5 deg"]', '["-7 deg", "5.5 deg"]'),
        ('["-7.7 deg", "-4.1 deg", "-0.5 deg", "3.1 deg", "6.7 deg"]', '["-4.1 deg", "3.1 deg"]'),
    ),
}
LATENCY: Final = ('latency = "2 s"', 'latency = "1 s"\ntimeout = "60 s"')
"""Of the emulated cameras: each view waits for all of it, and pictures that come later end the run.

A machine that is too busy to render any is no lost camera.
"""


@dataclass(frozen=True)
class Outcome:
    """What a rig was found to be like, and what it is like: the camera's poses (n, 4, 4) in the world."""

    found: NDArray[np.float64]
    covariances: NDArray[np.float64]
    """(n, 6, 6)"""
    true: NDArray[np.float64]


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


def quicker(name: str, folder: Path) -> Path:
    """Write a shipped profile with its changes."""
    path = folder / f"{name}.toml"
    path.write_text(files("hw_profiles").joinpath(path.name).read_text(encoding="utf-8"), encoding="utf-8")
    rewrite(path, CHANGES[name])
    return path


def rewrite(path: Path, changes: Iterable[tuple[str, str]]) -> None:
    """Replace what is in a file."""
    text = path.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")


def calibrate(http: httpx.Client) -> dict[str, Any]:
    """Run the profile's procedure to its end, taken up again wherever the machine was too busy for its pictures."""
    deadline = time.monotonic() + PATIENCE
    run = begun(http, "/runs", deadline)
    while run["state"] == "running" or HELD_UP in str(run["error"]):
        assert time.monotonic() < deadline, run
        if run["state"] != "running":
            begun(http, f"/runs/{run['id']}/resume", deadline)
        time.sleep(0.5)
        run = http.get(f"/runs/{run['id']}").json()
    return run


def begun(http: httpx.Client, path: str, deadline: float) -> dict[str, Any]:
    """Begin a run, once the camera is there."""
    while (answer := http.post(path)).status_code != 202:
        assert answer.json()["code"] == "rig_fault", answer.text
        assert time.monotonic() < deadline, answer.text
        time.sleep(0.5)
    return dict(answer.json())


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


def outcome(name: str, folder: Path) -> Outcome:
    """Emulate a rig, serve it, calibrate it, and ask for poses."""
    given, served = quicker(name, folder), folder / "served.toml"
    with running("simulate", str(given), "-o", str(served), "--json") as (_, places):
        assert json.loads(places)["profile"] == str(served)
        rewrite(served, [LATENCY])
        data = str(folder / "data")
        with running("serve", "--profile", str(served), "--data", data, "--port", "0") as (_, ready):
            address = ready.partition(" at ")[2].partition(" (")[0]
            with httpx.Client(base_url=address, timeout=60) as http:
                run = calibrate(http)
                assert run["state"] == "succeeded", run
                profile = load_profile(served)
                readings = some_readings(profile)
                answer = http.post("/pose", json={"readings": readings.tolist()}).json()
    found, covariances = (
        np.array([pose[key] for pose in answer["poses"]]) for key in ("world_from_camera", "covariance")
    )
    return Outcome(found, covariances, true_poses(profile, readings))


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Future[Outcome]]:
    """Every rig's, calibrated side by side: they wait for their axes most of the time."""
    with ThreadPoolExecutor() as side_by_side:
        return {name: side_by_side.submit(outcome, name, tmp_path_factory.mktemp(name)) for name in CHANGES}


@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", CHANGES)
def test_a_calibrated_rig_knows_where_its_camera_is_and_how_well(
    name: str, outcomes: Mapping[str, Future[Outcome]]
) -> None:
    rig = outcomes[name].result()
    errors = np.linalg.inv(rig.true) @ rig.found
    position = np.linalg.norm(errors[:, :3, 3], axis=1)
    rotation = np.linalg.norm(errors[:, [2, 0, 1], [1, 2, 0]] - errors[:, [1, 2, 0], [2, 0, 1]], axis=1) / 2
    spread = np.sqrt(np.diagonal(rig.covariances, axis1=1, axis2=2))
    assert position.max() < POSITION
    assert rotation.max() < ROTATION
    assert np.all(rotation < 3 * np.linalg.norm(spread[:, :3], axis=1))
    assert np.all(position < 3 * np.linalg.norm(spread[:, 3:], axis=1))
