"""One view from several frames: points averaged, with the variance that the frames' own scatter shows.

A frame's point is the view's, moved by what shakes the whole picture in that frame, and by noise of its own:

    pixel[k, i] = point[i] + shift[k] + noise[k, i]

The shift is one for all points, as of a camera that swings or trembles; it is told apart from the noise, and taken
out. Few frames tell a single point's variance badly: one number for all points of the view says how many times the
claimed covariances the scatter is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from calib.detection.detection import Detection
from calib.detection.detector import detect
from calib.detection.tracking import Prediction, track
from calib.errors import DetectionError
from calib.targets import Target, target_points, target_symmetries

Array = NDArray[np.float64]

WORTH_OF_CLAIMS = 10.0  # numbers of scatter; so many tell as much as the claimed covariances
SURE = 2.0  # standard deviations
MOVED = 0.1  # px
CLEAR_OF_NOISE = 3.0  # times what noise makes of it
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Averaged:
    """The mean of what was found in `frames` frames.

    The `detection`'s covariances are those of the mean. `shift_px` is how far the whole picture was from its mean
    place in a frame, `scatter_px` how far single points were besides (both rms); `moved_px` is the larger one of
    those that noise does not explain, None where it explains both.
    """

    detection: Detection
    frames: int
    shift_px: float
    scatter_px: float
    moved_px: float | None

    @property
    def warning(self) -> str | None:
        """In words, that the frames disagree; None where they do not."""
        if self.moved_px is None:
            return None
        return (
            f"between its {self.frames} frames the picture moved by {self.moved_px:.2g} px: wait longer for "
            "standstill, or find out what shakes the camera or the target"
        )


def detect_in_all(images: Iterable[NDArray[np.generic]], target: Target) -> Averaged:
    """Find the target's points in frames of one view, as `detect` does, and average them.

    Frames in which the target is not found are left out. Raises DetectionError, the first frame's, where it is
    found in none.
    """
    return _in_all(images, target, lambda image: detect(image, target))


def track_in_all(images: Iterable[NDArray[np.generic]], target: Target, predicted: Prediction) -> Averaged:
    """Measure the target's points in frames of one view where they are predicted, and average them.

    Frames are left out, and DetectionError is raised, as by `detect_in_all`.
    """
    return _in_all(images, target, lambda image: track(image, target, predicted))


def _in_all(
    images: Iterable[NDArray[np.generic]],
    target: Target,
    look: Callable[[NDArray[np.generic]], Detection],
) -> Averaged:
    detections, failure = [], None
    for image in images:
        try:
            detections.append(look(image))
        except DetectionError as error:
            failure = failure or error
    if not detections:
        raise failure or DetectionError("there is no picture to look at: a view has one frame or more")
    return average(detections, target)


def average(detections: Sequence[Detection], target: Target) -> Averaged:
    """Average what was found in one or more frames of one view, point by point over the frames that have it.

    A symmetric target is read in every frame the way round of the first.
    """
    first = detections[0]
    if len(detections) == 1:
        return Averaged(first, 1, 0.0, 0.0, None)
    seen = _Seen.of([first, *(_read_as(first, other, target) for other in detections[1:])], target)
    shifts = seen.shifts()
    points = seen.means(seen.pixels - shifts[:, None])
    present = seen.weights > 0
    left = np.where(present[..., None], seen.pixels - shifts[:, None] - points, 0.0)
    claimed = seen.means(seen.covariances)

    misfit = float((left * np.linalg.solve(claimed, left[..., None])[..., 0]).sum())
    freedom = 2.0 * max(int(present.sum()) - len(points) - len(shifts) + 1, 0)
    told = freedom + WORTH_OF_CLAIMS
    ratio = (misfit + WORTH_OF_CLAIMS) / told
    # What a claim has beyond the scatter is no noise: it is the same in every frame, and no mean makes it smaller.
    lasting = max(1 - ratio * (1 + SURE * sqrt(2 / told)), 0.0)
    covariances = claimed * (ratio / present.sum(axis=0) + lasting)[:, None, None]

    shift = float(np.square(shifts).sum()) / (len(shifts) - 1)
    of_noise = ratio * float((2 / seen.weights.sum(axis=1)).mean())
    scatter = 2 * float(np.square(left).sum()) / max(freedom, 2.0)
    pairs = ((shift, of_noise), (scatter, scatter / ratio))
    moved = [size for size, noise in pairs if size > max(MOVED**2, CLEAR_OF_NOISE**2 * noise)]
    return Averaged(
        detection=replace(first, ids=seen.ids, pixels=points, covariances=covariances),
        frames=len(detections),
        shift_px=sqrt(shift),
        scatter_px=sqrt(scatter),
        moved_px=sqrt(max(moved)) if moved else None,
    )


def _read_as(first: Detection, other: Detection, target: Target) -> Detection:
    """Return the other frame's detection, read the way round that is nearest to the first's."""
    places = np.zeros((len(target_points(target)), 2))
    places[first.ids] = first.pixels

    def away(label: NDArray[np.int64]) -> float:
        common = np.isin(label, first.ids)
        apart = np.linalg.norm(other.pixels - places[label], axis=1)[common]
        return float(np.median(apart)) if common.any() else np.inf

    labels = [other.ids, *(np.argsort(turn.permutation)[other.ids] for turn in target_symmetries(target))]
    return replace(other, ids=min(labels, key=away)) if np.isin(other.ids, first.ids).any() else other


@dataclass(frozen=True, eq=False)
class _Seen:
    """What n frames saw of q points: `pixels` (n, q, 2) and `covariances` (n, q, 2, 2).

    `weights` (n, q) are 1 over a coordinate's mean variance, and 0 where a frame lacks the point.
    """

    ids: NDArray[np.int64]
    pixels: Array
    covariances: Array
    weights: Array

    @classmethod
    def of(cls, detections: Sequence[Detection], target: Target) -> _Seen:
        count = len(detections), len(target_points(target))
        pixels, covariances = np.zeros((*count, 2)), np.zeros((*count, 2, 2))
        covariances[:] = np.eye(2)
        weights = np.zeros(count)
        for frame, detection in enumerate(detections):
            pixels[frame, detection.ids] = detection.pixels
            covariances[frame, detection.ids] = detection.covariances
            weights[frame, detection.ids] = 2 / np.trace(detection.covariances, axis1=1, axis2=2)
        ids = np.flatnonzero(weights.any(axis=0))
        return cls(ids, pixels[:, ids], covariances[:, ids], weights[:, ids])

    def means(self, values: Array) -> Array:
        """Return the weighted means (q, ...) of `values` (n, q, ...) over the frames."""
        return np.asarray(np.einsum("kq,kq...->q...", self.weights / self.weights.sum(axis=0), values))

    def shifts(self) -> Array:
        """Return by how much each frame's points lie off together (n, 2): least squares, none on the mean."""
        normal = np.diag(self.weights.sum(axis=1))
        normal -= self.weights @ (self.weights / self.weights.sum(axis=0)).T
        right = np.einsum("kq,kqi->ki", self.weights, self.pixels - self.means(self.pixels))
        sizes, ways = np.linalg.eigh(normal)
        # Frames that share no point with the others say nothing of how they are shifted against them.
        told = sizes > ROUNDING * self.weights.sum()
        return np.asarray(ways[:, told] @ (ways[:, told].T @ right / sizes[told, None]))
