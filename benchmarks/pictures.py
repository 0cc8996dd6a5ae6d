"""Image points at held-out readings, predicted by calibrations from rendered pictures: against truth, and as measured.

Random rigs of 2 to 4 joints before 42 printed disks: 1280 x 960 pixels, blur, noise, 9 views a joint, the lens unknown.
The truth of a point is the simulator's own projection of the disk's centre, without noise; what is measured holds the
noise of the held-out picture too, as all figures of a real rig do.
"""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from benchmarks.printing import console, say, table
from benchmarks.random_rigs import VIEWS
from benchmarks.rendered_rigs import readings_in_picture, rendered_rig, rendered_session
from benchmarks.true_rig import Array
from calib import paper, solve, verify
from calib.document import Method

JOINTS = (2, 3, 4)
HELD_OUT = 10
METHODS: Final[tuple[Method, ...]] = ("ml", "closed_form")


@dataclass(frozen=True, slots=True)
class Predicted:
    """Errors (px) of one calibration's predictions: each point's (n,) against truth, the means (v,) of the views."""

    true: Array
    measured: Array


def run(*, quick: bool) -> dict[str, float]:
    """Print the table; return the median errors."""
    rigs = 1 if quick else 4 * len(JOINTS)
    predicted = [predict(seed, JOINTS[seed % len(JOINTS)]) for seed in range(rigs)]
    say(f"{rigs} rigs of {JOINTS[0]} to {JOINTS[-1]} joints, {VIEWS} views a joint, {HELD_OUT} held out")
    rows = table(
        "Predicted image points (px)",
        "",
        "against truth: median",
        "worst 1 %",
        "against measured: mean",
        "views, min..max",
    )
    figures = {}
    for method in METHODS:
        true = np.concatenate([each[method].true for each in predicted])
        views = np.concatenate([each[method].measured for each in predicted])
        cells = [float(np.median(true)), float(np.quantile(true, 0.99)), float(views.mean())]
        spread = f"{views.min():.3f}..{views.max():.3f}"
        rows.add_row(method.replace("_", " "), *(f"{cell:.4f}" for cell in cells), spread)
        figures |= {f"{method}, true": cells[0], f"{method}, measured": cells[2]}
    theirs = [*paper.PREDICTION_AFTER_TRANSLATION_PX, *paper.PREDICTION_AFTER_ROTATION_PX]
    rows.add_row("the paper", "", "", f"{np.mean(theirs):.4f}", f"{min(theirs):.3f}..{max(theirs):.3f}")
    console.print(rows)
    return figures


def predict(seed: int, joints: int) -> dict[Method, Predicted]:
    """Render a random rig's session, and judge each method's predictions at its held-out readings."""
    rng = np.random.default_rng(seed)
    looking, world = rendered_rig(rng, joints)
    readings = readings_in_picture(looking, world, rng, HELD_OUT)
    true = np.array([world.project(world.target_points(), at) for at in readings])
    found = {}
    with TemporaryDirectory() as folder:
        session = rendered_session(looking, world, readings, Path(folder), rng)
        for method in METHODS:
            calibration = solve(session, method)
            away = calibration.project(world.target_points(), readings) - true
            views = [view.mean_px for view in verify(calibration, session).per_view]
            found[method] = Predicted(np.linalg.norm(away, axis=-1).ravel(), np.array(views, dtype=float))
    return found
