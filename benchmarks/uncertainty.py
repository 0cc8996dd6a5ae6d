"""The uncertainty that one calibration claims, beside the scatter of many: the same rig, with other noise each time.

A random rig of three joints, 0.1 px of noise, the lens unknown. All joints go together from one end of their sweeps to
the other, most of which no view of the fit has shown.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.cramer_rao import twists_between
from benchmarks.printing import console, say, table
from benchmarks.random_rigs import looking_rig, noisy_session
from benchmarks.true_rig import Array
from calib import solve

SEED, JOINTS, NOISE_PX = 1, 3, 0.1
ALONG: Final = np.linspace(0, 1, 11)
"""Where all joints are, from the low ends of their sweeps to the high ones."""
COMPONENTS: Final = ("rotation x", "rotation y", "rotation z", "position x", "position y", "position z")
"""Of a pose's twist, in the camera's frame."""


@dataclass(frozen=True, eq=False)
class Sampled:
    """Standard deviations (n, 6) of the twist at each reading: claimed by the first fit, and sampled over `draws`."""

    claimed: Array
    sampled: Array
    draws: int

    @property
    def sampling_error(self) -> float:
        """The relative standard error of one sampled deviation."""
        return float(1 / np.sqrt(2 * self.draws))


def run(*, quick: bool) -> dict[str, float]:
    """Print the table; return the mean ratio of sampled to claimed deviations of each component."""
    found = sample(draws=4 if quick else 200)
    ratios = found.sampled / found.claimed
    say(
        f"{found.draws} fits at {len(ALONG)} readings; one sampled deviation is known to "
        f"{100 * found.sampling_error:.0f} %, and those of one rig go together"
    )
    rows = table("Scatter over claimed standard deviation", "", "claimed", "sampled / claimed", "min..max")
    for place, component in enumerate(COMPONENTS):
        unit = "mrad" if component.startswith("rotation") else "mm"
        claimed, ratio = 1e3 * found.claimed[:, place], ratios[:, place]
        rows.add_row(
            f"{component} ({unit})",
            f"{claimed.min():.3f}..{claimed.max():.3f}",
            f"{ratio.mean():.3f}",
            f"{ratio.min():.3f}..{ratio.max():.3f}",
        )
    console.print(rows)
    return {component: float(ratio) for component, ratio in zip(COMPONENTS, ratios.mean(axis=0), strict=True)}


def sample(draws: int) -> Sampled:
    """Calibrate the rig `draws` times, each with noise of its own, and return what was claimed and what came out."""
    rng = np.random.default_rng(SEED)
    looking = looking_rig(rng, JOINTS)
    low, high = looking.ranges.T
    readings = low + ALONG[:, None] * (high - low)
    true = looking.rig.poses(readings)
    calibrations = [solve(noisy_session(looking, rng, NOISE_PX)) for _ in range(draws)]
    claimed = calibrations[0].pose_covariance(readings)
    assert claimed is not None
    twists = np.array([twists_between(true, found.world_from_camera(readings)) for found in calibrations])
    return Sampled(
        claimed=np.sqrt(np.diagonal(claimed, axis1=1, axis2=2)),
        sampled=np.sqrt((twists**2).mean(axis=0)),
        draws=draws,
    )
