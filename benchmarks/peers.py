"""The calibration beside peers that pip can install, on the same sessions: OpenCV 4's hand-eye solvers and pybotics.

The peers need a drawing of the chain, which ours does not: once the true one, once one from which the rig differs as
rigs do. They need the camera's poses too, and get those of our lens calibration. `make bench-peers` installs them.
"""

import json
import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Final

import numpy as np

from benchmarks.paper_table import METHODS
from benchmarks.peer_cases import Rig, peer_case, simulated_rig, standard_drawing
from benchmarks.printing import console, say, table
from benchmarks.true_rig import Array
from calib import Calibration, Session, load_session, solve, verify
from calib.first_solution import camera_views
from calib.lens import project_points
from calib.observations import observe
from calib.targets import target_points
from calib.transforms import pose_error
from daemon.profile import load_profile

ROOT = Path(__file__).parents[1]
PEERS = ROOT / ".venv-peers/bin/python"
SOLVERS = Path(__file__).with_name("peer_solvers.py")
DATA = Path(os.environ.get("ACTIVECAM_DATA", ROOT.parent / "shared/data"))

NOISE_PX = 0.1
RIGS: Final = {
    "paper-table": "a slide and a pan: all turning is about one axis",
    "pan-tilt": "two turning axes",
    "six-axis-arm": "six turning axes",
}
HELD_OUT = 4
"""Every so-manieth view of a real session is held out."""


@dataclass(frozen=True, slots=True)
class Found:
    """What one method makes of a case: held-out poses (n, 4, 4) and hand-eye (4, 4), in how many seconds."""

    poses: Array
    hand_from_camera: Array
    seconds: float


def run(*, quick: bool) -> dict[str, float]:
    """Print a table a rig; return the mean position errors (mm), and the errors of real held-out points (px)."""
    if not PEERS.exists():
        say("not installed: OpenCV 4 and pybotics, whose rows are left out; 'make bench-peers' installs them")
    say(
        f"Simulated rigs of the shipped profiles, {NOISE_PX} px noise, judged at their held-out readings. "
        "Beside its drawing a rig is built 1 mm, 0.5 deg, 1 deg of zero-offset and 1 % of scale off (std)."
    )
    figures: dict[str, float] = {}
    for name in list(RIGS)[: 1 if quick else None]:
        figures |= _on_simulated(name)
    if not quick:
        figures |= _on_arm() | _on_positioner()
    return figures


def solved_by_peers(cases: Sequence[dict[str, Any]]) -> list[dict[str, Found | str]]:
    """Return what each peer found of each case by its name, or why it did not; nothing where they are not installed."""
    if not PEERS.exists():
        return [{} for _ in cases]
    command = [str(PEERS), str(SOLVERS)]
    done = subprocess.run(command, input=json.dumps(cases), capture_output=True, text=True, check=True)
    return [{name: _found(given) for name, given in case.items()} for case in json.loads(done.stdout)]


def _found(given: dict[str, Any]) -> Found | str:
    if "error" in given:
        return str(given["error"])
    return Found(np.array(given["poses"]), np.array(given["hand_from_camera"]), given["seconds"])


def _on_simulated(name: str) -> dict[str, float]:
    rng = np.random.default_rng(0)
    rig = simulated_rig(load_profile(name), NOISE_PX, rng)
    off = rig.drawing.as_built_beside(rng)
    exact, built = solved_by_peers([peer_case(rig.session, d, rig.held_out) for d in (rig.drawing, off)])
    rows = table(
        f"{name}: {RIGS[name]}",
        "",
        "position (mm)",
        "rotation (mrad)",
        "hand-eye (mm)",
        "(mrad)",
        "time (ms)",
    )
    figures = {}
    for method in METHODS:
        ours = _ours(rig, method)
        _add_row(rows, f"ours, {method.replace('_', ' ')}: by-product", ours, rig)
        figures[f"{name}, {method}"] = _errors(ours.poses, rig.true)[0]
    for title, peers in (("drawing exact", exact), ("built beside it", built)):
        rows.add_section()
        for peer, found in peers.items():
            _add_row(rows, f"{peer}, {title}", found, rig)
            if isinstance(found, Found):
                figures[f"{name}, {title}, {peer}"] = _errors(found.poses, rig.true)[0]
    console.print(rows)
    for peer, found in exact.items():
        if isinstance(found, str):
            say(f"{peer} fails: {found}")
    return figures


def _ours(rig: Rig, method: Any) -> Found:
    begin = perf_counter()
    calibration = solve(rig.session, method)
    spent = perf_counter() - begin
    hand = np.array(calibration.cameras[0].link_from_camera)
    return Found(calibration.world_from_camera(rig.held_out), hand, spent)


def _add_row(rows: Any, label: str, found: Found | str, rig: Rig) -> None:
    if isinstance(found, str):
        rows.add_row(label, "fails")
        return
    cells = [
        *_errors(found.poses, rig.true),
        *_errors(found.hand_from_camera[None], rig.hand_from_camera[None]),
    ]
    rows.add_row(label, *(f"{cell:.3f}" for cell in cells), f"{1e3 * found.seconds:.0f}")


def _errors(found: Array, true: Array) -> tuple[float, float]:
    """Return the mean errors of poses (n, 4, 4) in mm and mrad."""
    position, rotation = pose_error(found, true)
    return 1e3 * float(np.mean(position)), 1e3 * float(np.mean(rotation))


def _on_arm() -> dict[str, float]:
    """Every fourth view of a real arm, which brings its own drawing along, predicted from the others (px)."""
    if not (DATA / "nachi0117").is_dir():
        say(f"not there: the real arm 'nachi0117' in {DATA.name}; set ACTIVECAM_DATA to its folder")
        return {}
    session = _held_out(load_session(DATA / "nachi0117"))
    held = [index for index, view in enumerate(session.views) if view.use == "verify"]
    readings = session.readings()[held]
    (peers,) = solved_by_peers([peer_case(session, standard_drawing(session), readings)])
    rows = table(f"nachi0117, a real six-axis arm: {len(held)} views held out", "", "rms (px)", "time (ms)")
    begin = perf_counter()
    calibration = solve(session)
    spent = perf_counter() - begin
    figures = {"nachi0117, ml": verify(calibration, session).rms_px or 0.0}
    rows.add_row("ours, ml", f"{figures['nachi0117, ml']:.3f}", f"{1e3 * spent:.0f} with detection")
    for peer, found in peers.items():
        if isinstance(found, str):
            rows.add_row(peer, "fails")
            continue
        figures[f"nachi0117, {peer}"] = _points_rms(session, held, found.poses)
        rows.add_row(peer, f"{figures[f'nachi0117, {peer}']:.3f}", f"{1e3 * found.seconds:.0f}")
    console.print(rows)
    return figures


def _held_out(session: Session) -> Session:
    views = [
        view.model_copy(update={"use": "verify" if index % HELD_OUT == HELD_OUT - 1 else "fit"})
        for index, view in enumerate(session.views)
    ]
    return session.with_views(views)


def _points_rms(session: Session, held: Sequence[int], poses: Array) -> float:
    """Return the rms (px) of the points of views `held` for a camera at `poses`, with the lens of the other views."""
    observed = observe(session).observations
    lens = camera_views(session, [o for o in observed if o.view not in held]).lenses[0]
    assert lens is not None
    world, away = target_points(session.target), []
    for pose, seen in zip(poses, [o for o in observed if o.view in held], strict=True):
        points = (world[seen.ids] - pose[:3, 3]) @ pose[:3, :3]
        away.append(project_points(points, lens) - seen.pixels)
    return float(np.sqrt((np.concatenate(away) ** 2).sum(axis=1).mean()))


def _on_positioner() -> dict[str, float]:
    """Judge ours alone on the real positioner: it has no drawing, without which the peers cannot begin."""
    if not (DATA / "positioner-cross").is_dir():
        say(f"not there: the real positioner in {DATA.name}; set ACTIVECAM_DATA to its folder")
        return {}
    session, rest = (load_session(DATA / f"positioner-{part}") for part in ("cross", "rest"))
    rows = table(
        "A real positioner, judged on 177 other views: there is no drawing for the peers", "", "mm", "mrad"
    )
    figures = {}
    for method in METHODS:
        calibration: Calibration = solve(session, method)
        found = verify(calibration, rest)
        assert found.position_m is not None
        assert found.rotation_rad is not None
        figures[f"positioner, {method}"] = 1e3 * found.position_m.mean
        cells = (1e3 * found.position_m.mean, 1e3 * found.rotation_rad.mean)
        rows.add_row(f"ours, {method.replace('_', ' ')}", *(f"{cell:.3f}" for cell in cells))
    console.print(rows)
    return figures
