"""Time of `solve` from image points over `cv2.calibrateCamera` alone on the same views.

45 views of 42 points on the paper's simulated table, pixels off by 0.1 px. `solve` finds lens, chain, mount,
base and the covariance of it all; the peer finds the lens and the views' poses, and nothing else. The verdict, which
judges each view by the calibration and by the fit of all others, is timed apart.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from statistics import median
from time import perf_counter
from typing import Any
from unittest.mock import patch

import cv2
import numpy as np

from benchmarks.paper_rig import session_of_points
from benchmarks.printing import add_pairs, console, say, table, timing_table
from benchmarks.timing import in_turns, seconds, threads
from calib import Session, solve, solver
from calib.disks import centroid_offsets
from calib.targets import disk_diameter, target_points
from calib.transforms import inverse

NOISE_PX = 0.1
POINTS = 42
STEPS = {
    "camera_views": "lens calibration, and the pose of each view",
    "first_solution": "closed form, with the target's other ways round",
    "most_likely": "maximum likelihood, with its covariance",
    "judged": "the verdict: each view by the calibration, and by the fit of all others",
}
"""The steps of `solve`, by the names of their functions in `calib.solver`."""
VERDICT = "judged"


def run(*, quick: bool) -> dict[str, float]:
    """Print the table; return the ratios."""
    cv2.setNumThreads(1)
    views, pairs = (12, 2) if quick else (45, 15)
    session = session_of_points(views, NOISE_PX)
    say(f"{views} views of {POINTS} points, {NOISE_PX} px noise; {pairs} pairs; {threads()}")
    rows = timing_table("Solve time from image points, without the verdict (ms)")
    opencv = peer(session)
    figures = {}
    for label, given in (("points / calibrateCamera", session), ("disks / calibrateCamera", _disks(session))):
        timed = in_turns(partial(_seconds_to_solve, given), partial(seconds, opencv), pairs)
        add_pairs(rows, label, timed, factor=1e3)
        figures[label] = timed.ratio.median
    console.print(rows)
    say(
        "Disks are the same points as detection gives them, as centroids of disks: what each is off by is then "
        "predicted while the fit goes on."
    )
    _print_shares(session, repeats=pairs)
    return figures


def peer(session: Session) -> Callable[[], object]:
    """Return OpenCV's calibration of the session's views, ready to be called."""
    world = target_points(session.target).astype(np.float32)
    seen = [view.points for view in session.views if view.points is not None]
    objects = [world[points.ids] for points in seen]
    images = [np.array(points.pixels, dtype=np.float32) for points in seen]
    camera = session.cameras[0]
    assert camera.width is not None
    assert camera.height is not None
    size = camera.width, camera.height
    return lambda: cv2.calibrateCamera(objects, images, size, np.eye(3), np.zeros(5))


def _disks(session: Session) -> Session:
    """Return the session with centroids of disks in place of their centres, as its calibration has them."""
    calibration, diameter = solve(session), disk_diameter(session.target)
    lens = calibration.cameras[0].intrinsics
    assert lens is not None
    assert diameter is not None
    poses = calibration.world_from_camera(session.readings())
    views = []
    for view, pose in zip(session.views, poses, strict=True):
        assert view.points is not None
        centres = target_points(session.target)[view.points.ids]
        pixels = view.points.pixels + centroid_offsets(centres, inverse(pose), diameter, lens)
        changed = {"disk": "centroid", "pixels": pixels.tolist()}
        views.append(view.model_copy(update={"points": view.points.model_copy(update=changed)}))
    return session.with_views(views)


def _seconds_to_solve(session: Session) -> float:
    """Return how long `solve` takes without its verdict."""
    with _clocked() as clock:
        return seconds(lambda: solve(session)) - clock[VERDICT]


def _print_shares(session: Session, repeats: int) -> None:
    """Print which of its steps `solve` spends its time in."""
    taken: dict[str, list[float]] = {name: [] for name in [*STEPS, "rest"]}
    for _ in range(repeats):
        with _clocked() as clock:
            whole = seconds(lambda: solve(session))
        for name, spent in clock.items():
            taken[name].append(spent)
        taken["rest"].append(whole - sum(clock.values()))
    medians = {name: median(values) for name, values in taken.items()}
    rows = table("Where the time of 'solve' goes", "step", "median (ms)", "share (%)")
    for name, spent in medians.items():
        label = STEPS.get(name, "the rest: reading the points, writing the document")
        rows.add_row(label, f"{1e3 * spent:.2f}", f"{100 * spent / sum(medians.values()):.1f}")
    console.print(rows)


@contextmanager
def _clocked() -> Iterator[dict[str, float]]:
    """Add up the seconds spent in each step meanwhile; a step that the solver no longer has is an error."""
    clock = dict.fromkeys(STEPS, 0.0)

    def timed(name: str) -> Callable[..., Any]:
        step = getattr(solver, name)

        def wrapper(*args: Any, **kwargs: Any) -> Any:
            begin = perf_counter()
            try:
                return step(*args, **kwargs)
            finally:
                clock[name] += perf_counter() - begin

        return wrapper

    with ExitStack() as patched:
        for name in STEPS:
            patched.enter_context(patch.object(solver, name, timed(name)))
        yield clock
