"""Grids of tags: each tag found by itself, its corners numbered by its id."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.detection import Detection
from calib.detection.markers import searches
from calib.detection.picture import Picture
from calib.detection.plane import view_of_most
from calib.detection.tag_corners import measure_tags
from calib.detection.two_prints import two_prints
from calib.errors import DetectionError
from calib.targets import AprilGrid, marker_dictionary, target_points

MISPLACED = 0.25  # of a tag's side in the picture: more than a lens bends a grid


def detect_aprilgrid(picture: Picture, target: AprilGrid) -> Detection:
    """Find the tags that can be seen; raises DetectionError where there is none.

    Tags whose id is not of the grid or is seen twice, and tags out of their place among the others, are left
    out.
    """
    seen = _seen_tags(picture, target)
    if not len(seen.tags):
        raise _not_found(picture, target, seen)
    measured = measure_tags(picture, target, seen.tags, seen.corners)
    if not measured.found.any():
        raise _not_found(picture, target, seen)
    tags, pixels = seen.tags[measured.found], measured.pixels[measured.found]
    ids = 4 * tags[:, None] + np.arange(4)
    covariances = measured.covariances[measured.found]
    return Detection(ids.ravel(), pixels.reshape(-1, 2), covariances.reshape(-1, 2, 2), disk=None)


@dataclass(frozen=True, eq=False)
class _SeenTags:
    """The grid's tags (n,) that are seen once and in their place, by growing id, and roughly their corners (n, 4, 2).

    `markers` is how many markers with ids of the grid were seen, `twice` (m,) are the tags seen more than once.
    """

    tags: NDArray[np.int64]
    corners: NDArray[np.float64]
    markers: int
    twice: NDArray[np.int64]


def _seen_tags(picture: Picture, target: AprilGrid) -> _SeenTags:
    every = target.rows * target.columns
    known = marker_dictionary(target.dictionary)
    # The others need no names: looking up all of a large dictionary takes longer than all the rest.
    own = cv2.aruco.Dictionary(known.bytesList[:every].copy(), known.markerSize, known.maxCorrectionBits)
    for search in searches():
        found, numbers, _ = cv2.aruco.ArucoDetector(own, search).detectMarkers(picture.grey)
        # OpenCV says None where there is nothing, whatever the annotation says.
        ids = np.array([] if numbers is None else numbers, dtype=np.int64).ravel()
        seen = _in_place(target, ids, np.array(found, dtype=np.float64).reshape(-1, 4, 2))
        if len(seen.tags) == every:
            break
    return seen


def _in_place(target: AprilGrid, ids: NDArray[np.int64], found: NDArray[np.float64]) -> _SeenTags:
    """Leave out of the markers (n,), of corners (n, 4, 2), which are seen twice or out of place."""
    tags, first, times = np.unique(ids, return_index=True, return_counts=True)
    once, twice, corners = tags[times == 1], tags[times > 1], found[first[times == 1]]
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    tolerance = MISPLACED * float(np.median(sides)) if len(once) else 0.0
    plane = target_points(target)[:, :2].reshape(-1, 4, 2)[once]
    view = view_of_most(plane.reshape(-1, 2), corners.reshape(-1, 2), tolerance)
    in_place = np.zeros(len(once), dtype=bool) if view is None else view[1].reshape(-1, 4).all(axis=1)
    return _SeenTags(once[in_place], corners[in_place], len(ids), twice)


def _not_found(picture: Picture, target: AprilGrid, seen: _SeenTags) -> DetectionError:
    grid = f"the AprilGrid of {target.rows} x {target.columns}"
    if len(seen.twice) and not len(seen.tags):
        return two_prints("tag", grid, seen.twice)
    return DetectionError(
        f"no tag of {grid} was found: {seen.markers} markers of {target.dictionary} with ids below "
        f"{target.rows * target.columns} were seen in the picture of {picture.size}; is it in the picture, sharp "
        f"and evenly lit?"
    )
