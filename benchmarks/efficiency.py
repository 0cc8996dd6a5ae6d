"""Pose errors at held-out readings, squared over the Cramer-Rao bound, and how often the claimed ellipsoids hold.

Random simulated rigs of 2 to 4 joints: 9 views a joint, 0.1 px of noise, the lens unknown. The bound is that of the
simulator, by numerical differentiation (`cramer_rao`): 1 is the best that any unbiased method can do.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import chi2

from benchmarks.cramer_rao import pose_bound, twists_between
from benchmarks.printing import console, say, table
from benchmarks.random_rigs import VIEWS, LookingRig, looking_rig, noisy_session
from benchmarks.true_rig import Array
from calib import Calibration, solve
from calib.document import Method

NOISE_PX = 0.1
JOINTS = (2, 3, 4)
HELD_OUT = 20
"""Readings of each rig, anywhere inside its sweeps, at which its poses are judged."""
METHODS: Final[tuple[Method, ...]] = ("ml", "closed_form")

PARTS: Final = {"position": slice(3, 6), "rotation": slice(3), "both": slice(6)}
"""Of a twist."""
SURE = 0.95


@dataclass(frozen=True, eq=False)
class Judged:
    """One calibration's errors: twists (n, 6) from the true poses, their bound (n, 6, 6), and what it claims itself."""

    twists: Array
    bound: Array
    claimed: Array | None

    def ratio(self, part: slice) -> float:
        """Return the mean squared error over the bound, a dimension."""
        twists = self.twists[:, part]
        return float(_distances(twists, self.bound[:, part, part]).mean()) / twists.shape[1]

    def covered(self, part: slice) -> float:
        """Return the share of the true poses that lie in the claimed ellipsoids."""
        assert self.claimed is not None
        twists = self.twists[:, part]
        within = _distances(twists, self.claimed[:, part, part]) < chi2.ppf(SURE, twists.shape[1])
        return float(within.mean())


@dataclass(frozen=True, slots=True)
class Mean:
    """A mean over rigs, and its standard error: errors within a rig go together, rigs are independent."""

    value: float
    error: float

    @classmethod
    def of(cls, values: Sequence[float]) -> "Mean":
        """Return the mean of a figure of each rig."""
        return cls(float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(len(values))))

    def text(self, digits: int, factor: float = 1.0) -> str:
        """Return both, as a cell of a table."""
        return f"{factor * self.value:.{digits}f} ± {factor * self.error:.{digits}f}"


def run(*, quick: bool) -> dict[str, float]:
    """Print the tables; return each method's mean ratios, and what the claimed ellipsoids hold."""
    rigs = 2 * len(JOINTS) if quick else 80 * len(JOINTS)
    judged: dict[Method, list[Judged]] = {method: [] for method in METHODS}
    for seed in range(rigs):
        for method, found in judge(seed).items():
            judged[method].append(found)
    say(
        f"{rigs} rigs of {JOINTS[0]} to {JOINTS[-1]} joints, {VIEWS} views a joint, {NOISE_PX} px noise, lens unknown; "
        f"{HELD_OUT} held-out readings a rig; ± is the standard error over rigs"
    )
    return _print_ratios(judged) | _print_coverage(judged["ml"])


def judge(seed: int) -> dict[Method, Judged]:
    """Solve a random rig's session by each method, and return the errors at held-out readings."""
    rng = np.random.default_rng(seed)
    looking = looking_rig(rng, JOINTS[seed % len(JOINTS)])
    session = noisy_session(looking, rng, NOISE_PX)
    readings = looking.readings(rng, HELD_OUT)
    bound = pose_bound(looking, readings, NOISE_PX)
    return {method: _judged(looking, readings, bound, solve(session, method)) for method in METHODS}


def _judged(looking: LookingRig, readings: Array, bound: Array, calibration: Calibration) -> Judged:
    twists = twists_between(looking.rig.poses(readings), calibration.world_from_camera(readings))
    return Judged(twists, bound, calibration.pose_covariance(readings))


def _distances(twists: Array, covariances: Array) -> Array:
    """Return the squared distances (n,) of twists (n, d) in units of their covariances (n, d, d)."""
    solved = np.linalg.solve(covariances, twists[..., None])[..., 0]
    distances: Array = (twists * solved).sum(axis=1)
    return distances


def _print_ratios(judged: Mapping[Method, Sequence[Judged]]) -> dict[str, float]:
    rows = table(
        "Squared pose error over the Cramer-Rao bound",
        "",
        "ml: mean",
        "median",
        "closed form: mean",
        "median",
    )
    figures = {}
    for name, part in PARTS.items():
        cells = []
        for method in METHODS:
            ratios = [each.ratio(part) for each in judged[method]]
            mean = Mean.of(ratios)
            cells += [mean.text(2), f"{np.median(ratios):.2f}"]
            figures[f"{method}, {name}"] = mean.value
        rows.add_row(name, *cells)
    console.print(rows)
    return figures


def _print_coverage(judged: Sequence[Judged]) -> dict[str, float]:
    rows = table(f"Inside the claimed {SURE:.0%} ellipsoids", "", "ml (%)", "closed form (%)")
    figures = {}
    for name, part in PARTS.items():
        mean = Mean.of([each.covered(part) for each in judged])
        rows.add_row(name, mean.text(1, factor=100), "claims none")
        figures[f"covered, {name}"] = mean.value
    console.print(rows)
    return figures
