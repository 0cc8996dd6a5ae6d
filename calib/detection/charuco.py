"""ChArUco boards: corners of a chessboard, numbered by the markers round them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.corners import measure_corners
from calib.detection.detection import Detection
from calib.detection.markers import searches
from calib.detection.picture import Picture
from calib.detection.plane import span_a_plane, view_of_most
from calib.detection.two_prints import two_prints
from calib.errors import DetectionError
from calib.targets import Charuco, marker_dictionary, target_points

MISPLACED = 0.25  # of a marker's side in the picture: more than a lens bends a board


def detect_charuco(picture: Picture, target: Charuco) -> Detection:
    """Find the inner corners in view; raises DetectionError where they are fewer than 4 or on one line."""
    seen = _seen_corners(picture, target)
    plane = target_points(target)[:, :2]
    most = view_of_most(plane[seen.ids], seen.corners, seen.tolerance)
    if most is None:
        raise _not_found(picture, target, len(seen.ids), seen.markers)
    view, in_place = most
    ids, rough = seen.ids[in_place], seen.corners[in_place]
    clear = (target.pitch - target.marker) / 2
    # OpenCV 4's corners are half a pixel off, and some are none, which measuring them anew mends.
    corners = measure_corners(picture, view, plane[ids], rough, target.pitch, clear)
    there = np.flatnonzero(corners.found)
    if not span_a_plane(plane[ids[there]]):
        raise _not_found(picture, target, len(there), seen.markers)
    order = there[np.argsort(ids[there])]
    return Detection(ids[order], corners.pixels[order], corners.covariances[order], disk=None)


@dataclass(frozen=True, eq=False)
class _SeenCorners:
    """Roughly the `corners` (n, 2) of the `ids` (n,), give or take `tolerance` px; and the ids of `markers` (m,)."""

    ids: NDArray[np.int64]
    corners: NDArray[np.float64]
    tolerance: float
    markers: NDArray[np.int64]


def _seen_corners(picture: Picture, target: Charuco) -> _SeenCorners:
    shape = (target.columns, target.rows)
    board = cv2.aruco.CharucoBoard(shape, target.pitch, target.marker, marker_dictionary(target.dictionary))
    beside = cv2.aruco.CharucoParameters()
    beside.minMarkers = (
        1  # of the two round a corner: else one that is covered takes up to four corners with it
    )
    for search in searches():
        detector = cv2.aruco.CharucoDetector(board, beside, search)
        near, numbers, outlines, known = detector.detectBoard(picture.grey)
        # OpenCV says None where there is nothing, whatever the annotation says.
        ids = np.array([] if numbers is None else numbers, dtype=np.int64).ravel()
        if len(ids) == len(target_points(target)):
            break
    corners = np.array([] if near is None else near, dtype=np.float64).reshape(-1, 2)
    outline = np.array([] if outlines is None else outlines, dtype=np.float64).reshape(-1, 4, 2)
    sides = np.linalg.norm(outline - np.roll(outline, -1, axis=1), axis=2)
    markers = np.array([] if known is None else known, dtype=np.int64).ravel()
    return _SeenCorners(ids, corners, MISPLACED * float(np.median(sides)) if sides.size else 0.0, markers)


def _not_found(picture: Picture, target: Charuco, corners: int, markers: NDArray[np.int64]) -> DetectionError:
    board = f"the ChArUco board of {target.rows} x {target.columns} squares"
    different, times = np.unique(markers, return_counts=True)
    if np.any(times > 1):
        return two_prints("marker", board, different[times > 1])
    return DetectionError(
        f"{board} was not found: {corners} corners and {len(different)} markers of {target.dictionary} were seen in "
        f"the picture of {picture.size}, and 4 corners not on one line are needed; is it in view and sharp?"
    )
