"""A target measured where it is expected to be: only the places predicted are looked at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib.detection.crossings import crossings_of
from calib.detection.detection import Detection
from calib.detection.lattice import Lattice
from calib.detection.looks import Looks, look_at
from calib.detection.marks import Marks, marks_of
from calib.detection.picture import Picture, require_picture
from calib.detection.places import Places
from calib.detection.plane import FEWEST, BentView, bent_view, span_a_plane, view_of_plane
from calib.detection.shifts import moved_together, shifts_of
from calib.detection.smooth import smooth
from calib.detection.sparse_corners import sparse_corners
from calib.detection.sparse_disks import SparseDisks, sparse_centroids
from calib.detection.tag_corners import track_tags
from calib.detection.window import Window, window_on
from calib.errors import DetectionError
from calib.targets import AprilGrid, AsymmetricCircleGrid, CircleGrid, Target, target_points

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

OFF_DEGREE = 1  # of what is smooth
OFF_TIMES, OFF_PX = 5.0, (0.3, 1.5)  # times the median off it, within limits
MOST_MISSING = 0.1  # of the points confirmed; a row or column is more
MISPLACED, MISPLACED_PX = 0.05, 0.75  # of the distance between marks, and px more
LEFT = 0.06  # of the contrast, by a fit; and
LEFT_OF_NOISE = 3.0  # times the noise


@dataclass(frozen=True, eq=False)
class Prediction:
    """Where points are expected: `pixels` (n, 2) of the ids (n,), no more than `off` px away from where they are."""

    ids: NDArray[np.int64]
    pixels: Array
    off: float

    @classmethod
    def of(cls, detection: Detection, off: float) -> Prediction:
        """Expect the points where they were seen before, but for a motion of up to `off` px."""
        return cls(detection.ids, detection.pixels, off)


def track(image: NDArray[np.generic], target: Target, predicted: Prediction) -> Detection:
    """Measure the target's points where they are predicted, in a picture as `detect` takes it.

    The prediction tells how the target lies: points that are not in it are looked for as well, where the others say.
    Points that are out of the picture, covered, or not where the others say are left out. Of a grid without numbers,
    so much must be seen that it can't be shifted: points at both ends both ways, or at one end, with none beyond.
    A target that looks the same after a turn is read as predicted.

    It takes a part of the time of `detect`, as it measures on fewer pixels, and points scatter more.
    A prediction that is off by more than it says, or by half the distance between neighbouring points, is as good as
    none.

    Raises DetectionError where too few points are there to be sure of them: look for the target with `detect`.
    """
    require_picture(image)
    middle = (np.array(image.shape[1::-1]) - 1) / 2
    marks = marks_of(target)
    places = Places.expected(marks, _view(target, predicted, middle))
    window = window_on(image, places, predicted.off)
    places = places.moved([-window.left, -window.top])
    places = moved_together(places, *shifts_of(window, marks, places, predicted.off))

    looks = look_at(window, marks, places)
    own = len(marks.points)
    chosen = np.flatnonzero(looks.agreeing[:own] >= marks.agreeing)
    measured = _measured(window, target, marks, places, looks, chosen)
    ids = marks.points[chosen][measured.good]
    if not span_a_plane(target_points(target)[ids, :2]):
        raise DetectionError(
            f"the {target.kind.replace('_', ' ')} is not where it was predicted to within {predicted.off:.0f} px: "
            f"of its {len(target_points(target))} points {len(ids)} were confirmed, and {FEWEST} not on one line are "
            "needed; look for it in the whole picture"
        )
    if marks.lattice is not None and not _is_unshifted(marks.lattice, marks, looks, ids):
        raise DetectionError(
            f"{len(ids)} of {own} points of the {target.kind.replace('_', ' ')} were confirmed, but the grid may be "
            "shifted by some rows or columns, as its ends are not seen; look for it in the whole picture"
        )
    disk: Literal["centroid"] | None = (
        "centroid" if isinstance(target, CircleGrid | AsymmetricCircleGrid) else None
    )
    pixels = measured.pixels[measured.good] + [window.left, window.top]
    return Detection(ids, pixels, measured.covariances[measured.good], disk)


def _view(target: Target, predicted: Prediction, middle: Array) -> BentView:
    points = target_points(target)[predicted.ids, :2]
    view = view_of_plane(points, predicted.pixels)
    if view is None:
        raise DetectionError(
            f"{len(points)} predicted points don't tell where the target lies: {FEWEST} or more not on one line do"
        )
    return bent_view(view, points, predicted.pixels, middle)


def _is_unshifted(lattice: Lattice, marks: Marks, looks: Looks, ids: NDArray[np.int64]) -> bool:
    """Tell whether the points found can be no others of the grid.

    None may be seen beyond its rim. Where its ends are out of the picture, bare places beyond the other ends speak for
    it, but only if hardly a point is missing in the picture: what covers one may cover those beyond the rim, too.
    """
    own = len(marks.points)
    confirmed = np.bincount(ids, minlength=own) > 0
    beside = confirmed[marks.nearest[own:]]
    if np.any(beside & (looks.agreeing[own:] >= marks.agreeing)):
        return False
    missing = np.count_nonzero(looks.whole[:own] & ~confirmed)
    bare = np.flatnonzero(looks.bare & beside & (missing <= MOST_MISSING * len(ids)))
    return lattice.is_certain(np.flatnonzero(confirmed), bare)


class _Measured(NamedTuple):
    """Marks' points: `pixels` (c, q, 2), `covariances` (c, q, 2, 2) in px², and which of them are `good` (c, q)."""

    pixels: Array
    covariances: Array
    good: Mask


def _measured(
    window: Window, target: Target, marks: Marks, places: Places, looks: Looks, chosen: NDArray[np.int64]
) -> _Measured:
    """Measure the points of the chosen marks (c,); good are those that fit to the picture, and to the others."""
    near, across = places.points[chosen], places.across[chosen]
    if not len(chosen):
        return _Measured(near, np.empty((*near.shape, 2)), np.empty(near.shape[:2], dtype=bool))
    reaches = np.hypot(across[..., 0], across[..., 1]).min(axis=1)
    match target:
        case CircleGrid() | AsymmetricCircleGrid():
            paper, ink = looks.paper[chosen], looks.ink[chosen]
            measured = _disks(window, target, places.edges[chosen], near, paper, ink)
        case AprilGrid():
            measured = _tags(window, target, near, places.view, chosen)
        case _:
            measured = _corners(window, marks, places, looks, chosen)
    pixels, covariances, good = measured
    misplaced = np.linalg.norm(pixels - near, axis=2)
    good &= misplaced < MISPLACED_PX + MISPLACED * marks.spacing / marks.clear * reaches[:, None]
    return _Measured(pixels, covariances, _agreeing(near, pixels, good))


def _agreeing(near: Array, pixels: Array, good: Mask) -> Mask:
    """Choose the good points that are off their places (c, q, 2) as their neighbours are, and their own mark's."""
    off = pixels - near
    own = np.linalg.norm(off - off.mean(axis=1, keepdims=True), axis=2).max(axis=1, keepdims=True)
    for _ in range(2):
        if not good.any():
            break
        bend = smooth(near[good], off[good], OFF_DEGREE)
        apart = np.maximum(np.linalg.norm(off - bend.at(near), axis=2), own)
        good = good & (apart < np.clip(OFF_TIMES * np.median(apart[good]), *OFF_PX))
    return good


def _disks(
    window: Window,
    target: CircleGrid | AsymmetricCircleGrid,
    edges: Array,
    near: Array,
    paper: Array,
    ink: Array,
) -> _Measured:
    quarter = edges.shape[1] // 4
    disks = SparseDisks(
        centres=near[:, 0],
        shapes=(edges[:, [0, quarter]] - edges[:, [2 * quarter, 3 * quarter]]).swapaxes(1, 2) / 2,
        clear=target.spacing / target.disk_diameter,
        paper=paper,
        ink=ink,
    )
    found = sparse_centroids(window.values, disks)
    good = found.good & (found.left < np.maximum(LEFT_OF_NOISE * window.noise, LEFT * np.abs(paper - ink)))
    return _Measured(found.pixels[:, None], found.covariances[:, None], good[:, None])


def _corners(
    window: Window, marks: Marks, places: Places, looks: Looks, chosen: NDArray[np.int64]
) -> _Measured:
    points, near = marks.middles[chosen], places.points[chosen, 0]
    crossings = crossings_of(places.view, points, near, marks.spacing, marks.clear)
    picture = Picture(np.empty((0, 0), np.uint8), window.values, window.noise)
    found = sparse_corners(picture, crossings, np.maximum(looks.paper, looks.ink)[chosen])
    good = found.good & (
        found.left < np.maximum(LEFT_OF_NOISE * window.noise, 2 * LEFT * np.abs(found.steps))
    )
    return _Measured(found.pixels[:, None], found.covariances[:, None], good[:, None])


def _tags(
    window: Window, target: AprilGrid, near: Array, view: BentView, chosen: NDArray[np.int64]
) -> _Measured:
    picture = Picture(np.empty((0, 0), np.uint8), window.values, window.noise)
    found = track_tags(picture, target, chosen, near, view)
    good = np.repeat(found.found[:, None], near.shape[1], axis=1)
    return _Measured(found.pixels, found.covariances, good)
