"""Where detectors put points, on rendered plates of all kinds: beside OpenCV's own, and the bound.

A disk is judged by its centroid's true picture, a corner by its own. Over pictures that differ by their noise
alone, bias is each point's mean error and scatter what is left of it; both, and rms, are the root of the mean
square over points. The bound is the Cramer-Rao one, of disks and of a chessboard's corners, as if the place
of each were all that is unknown.
"""

from dataclasses import dataclass
from functools import partial
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.peer_detectors import Detector, Found, Picture, peers
from benchmarks.picture_bound import place_bounds
from benchmarks.printing import console, say, table
from benchmarks.rendered_plates import TARGETS, Printed, Scene, SeenPlate
from benchmarks.timing import seconds, threads
from benchmarks.true_rig import Array
from calib.detection import detect
from calib.errors import DetectionError
from calib.targets import AprilGrid, Charuco, target_symmetries

USUAL: Final = Scene()
SCENES: Final = {
    "usual": USUAL,
    "not tilted": Scene(tilt=0),
    "tilt 45": Scene(tilt=45),
    "tilt 60": Scene(tilt=60),
    "blur 0.5 px": Scene(blur=0.5),
    "blur 2 px": Scene(blur=2.0),
    "noise 0.5": Scene(noise=0.5),
    "noise 8": Scene(noise=8.0),
    "even light": Scene(gradient=0.0),
    "gradient 0.5": Scene(gradient=0.5),
    "640 px": Scene(width=640),
    "640 px, small": Scene(width=640, fill=0.35),
    "2000 px": Scene(width=2000),
    "4000 px": Scene(width=4000),
    "640 px, all bad": Scene(width=640, tilt=60, blur=2.0, noise=8.0, gradient=0.5),
}
"""All but what is named is as usual: 1280 px, tilt 30, blur 0.8 px, noise 2, gradient 0.2."""
QUICK: Final = {"640 px": SCENES["640 px"]}
LOCKED: Final = 2.0
"""px; an answer with a point further off is a false lock."""


@dataclass(frozen=True)
class Judged:
    """One detector in one scene: px, shares of the points and of the pictures, ms.

    `bias`, `scatter` and `rms` are nan where it gave fewer than two right answers; `claimed` is the mean of
    squared errors over claimed covariances, per direction.
    """

    bias: float
    scatter: float
    rms: float
    claimed: float
    missed: float
    false_locks: float
    milliseconds: float


def run(*, quick: bool) -> dict[str, float]:
    """Print a table for each kind of target; return the main figures."""
    cv2.setNumThreads(1)
    scenes, draws = (QUICK, 2) if quick else (SCENES, 12)
    say(f"{draws} pictures a scene; {threads()}; the usual scene: {USUAL}")
    figures: dict[str, float] = {}
    for target in TARGETS:
        rows = table(
            target.kind, "scene, detector", "bias px", "scatter px", "rms px", "/ bound",
            "error² / claim", "missed", "false locks", "ms",
        )  # fmt: skip
        for name, scene in scenes.items():
            plate = SeenPlate(target, scene)
            bound = _bound(plate)
            for detector, judged in _judged(plate, draws).items():
                rows.add_row(f"{name}: {detector}", *_cells(judged, bound))
                if detector == "detect":
                    figures[f"{target.kind}, {name}: rms (px)"] = judged.rms
        console.print(rows)
    return figures


def _cells(judged: Judged, bound: float) -> list[str]:
    lengths = [_cell(value, 4) for value in (judged.bias, judged.scatter, judged.rms)]
    ratios = [_cell(value, 2) for value in (judged.scatter / bound, judged.claimed)]
    shares = [f"{100 * share:.0f} %" for share in (judged.missed, judged.false_locks)]
    return [*lengths, *ratios, *shares, f"{judged.milliseconds:.1f}"]


def _cell(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else "-"


def _bound(plate: SeenPlate) -> float:
    """Return the least scatter that a picture allows; nan where other edges than a point's own are near it."""
    if isinstance(plate.target, Charuco | AprilGrid):
        return float("nan")
    points = plate.points()
    apart = cKDTree(points).query(points, k=2)[0][:, 1].max()
    return float(np.sqrt(np.trace(place_bounds(plate, apart / np.sqrt(2)), axis1=1, axis2=2).mean()))


def _judged(plate: SeenPlate, draws: int) -> dict[str, Judged]:
    """Judge ours and the peers on the same pictures, taken in turns."""
    light, noise = plate.light(), np.random.default_rng(0)
    detectors: dict[str, Detector] = {"detect": partial(_ours, target=plate.target), **peers(plate.target)}
    judges = {name: _Judge(plate, detector) for name, detector in detectors.items()}
    for _ in range(draws):
        picture = plate.picture(light, noise)
        for judge in judges.values():
            judge.look_at(picture)
    return {name: judge.judged() for name, judge in judges.items()}


def _ours(picture: Picture, target: Printed) -> Found | None:
    try:
        detection = detect(picture, target)
    except DetectionError:
        return None
    return Found(detection.pixels, detection.ids, detection.covariances)


class _Judge:
    """Keeps what one detector said of pictures of one plate."""

    def __init__(self, plate: SeenPlate, detector: Detector) -> None:
        self._detector = detector
        self._truth = plate.points()
        every = np.arange(len(self._truth))
        self._readings = [every, *(symmetry.permutation for symmetry in target_symmetries(plate.target))]
        self._errors: list[Array] = []  # (n, 2) by id, nan where there is no point or a false one
        self._claims: list[float] = []
        self._false_locks = 0
        self._seconds: list[float] = []

    def look_at(self, picture: Picture) -> None:
        """Ask the detector, and judge its answer."""
        found: list[Found | None] = []
        self._seconds.append(seconds(lambda: found.append(self._detector(picture))))
        errors = np.full_like(self._truth, np.nan)
        answer = found[0]
        if answer is not None:
            ids = self._ids(answer)
            misses = answer.pixels - self._truth[ids]
            if len(np.unique(ids)) < len(ids) or np.abs(misses).max() > LOCKED:
                self._false_locks += 1
            else:
                errors[ids] = misses
                if answer.covariances is not None:
                    weighed = np.linalg.solve(answer.covariances, misses[..., None])[..., 0]
                    self._claims.append(float(np.mean(np.sum(misses * weighed, axis=1)) / 2))
        self._errors.append(errors)

    def judged(self) -> Judged:
        """Sum up."""
        errors = np.array(self._errors)
        seen = np.isfinite(errors).all(axis=2)
        often = seen.sum(axis=0) >= 2
        bias = scatter = rms = np.nan
        if often.any():
            counted = errors[:, often]
            variances = np.nanvar(counted, axis=0, ddof=1).sum(axis=1)
            means = np.square(np.nanmean(counted, axis=0)).sum(axis=1)
            # The mean of a few pictures keeps a part of their scatter.
            bias = np.sqrt(max(np.mean(means - variances / seen[:, often].sum(axis=0)), 0.0))
            scatter = np.sqrt(variances.mean())
            rms = np.sqrt(np.nanmean(np.square(counted).sum(axis=2)))
        return Judged(
            bias=float(bias),
            scatter=float(scatter),
            rms=float(rms),
            claimed=float(np.mean(self._claims)) if self._claims else float("nan"),
            missed=float(1 - seen.mean()),
            false_locks=self._false_locks / len(errors),
            milliseconds=1e3 * float(np.median(self._seconds)),
        )

    def _ids(self, answer: Found) -> NDArray[np.int64]:
        """Return the true ids of an answer, up to the target's own symmetries or, where it has none, by place."""
        if answer.ids is None:
            away = np.linalg.norm(answer.pixels[:, None] - self._truth, axis=2)
            return np.asarray(away.argmin(axis=1))
        asked = [np.asarray(reading[answer.ids]) for reading in self._readings]
        return min(asked, key=lambda ids: float(np.abs(answer.pixels - self._truth[ids]).max()))
