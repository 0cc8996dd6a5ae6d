"""ChArUco boards: corners of a chessboard, numbered by the markers round them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.corners import measure_corners
from calib.detection.detection import Detection
from calib.detection.picture import Picture
from calib.detection.plane import view_of_plane
from calib.detection.two_prints import two_prints
from calib.errors import DetectionError
from calib.targets import Charuco, marker_dictionary, target_points


def detect_charuco(picture: Picture, target: Charuco) -> Detection:
    """Find the inner corners in view; raises DetectionError where they are fewer than 4 or on one line."""
    dictionary = marker_dictionary(target.dictionary)
    board = cv2.aruco.CharucoBoard((target.columns, target.rows), target.pitch, target.marker, dictionary)
    near, numbers, _, seen = cv2.aruco.CharucoDetector(board).detectBoard(picture.grey)
    # OpenCV says None where there is nothing, whatever the annotation says.
    ids = np.array([] if numbers is None else numbers, dtype=np.int64).ravel()
    rough = np.array([] if near is None else near, dtype=np.float64).reshape(-1, 2)
    plane = target_points(target)[ids, :2]
    view = view_of_plane(plane, rough)
    if view is None:
        raise _not_found(picture, target, len(ids), np.array([] if seen is None else seen, np.int64))
    clear = (target.pitch - target.marker) / 2
    # OpenCV 4's corners are half a pixel off, and some are none, which measuring them anew mends.
    corners = measure_corners(picture, view, plane, rough, target.pitch, clear)
    there = np.flatnonzero(corners.found)
    if view_of_plane(plane[there], corners.pixels[there]) is None:
        raise _not_found(picture, target, len(there), np.array(seen, np.int64))
    order = there[np.argsort(ids[there])]
    return Detection(ids[order], corners.pixels[order], corners.covariances[order], disk=None)


def _not_found(picture: Picture, target: Charuco, corners: int, markers: NDArray[np.int64]) -> DetectionError:
    board = f"the ChArUco board of {target.rows} x {target.columns} squares"
    different, times = np.unique(markers, return_counts=True)
    if np.any(times > 1):
        return two_prints("marker", board, different[times > 1])
    return DetectionError(
        f"{board} was not found: {corners} corners and {len(different)} markers of {target.dictionary} were seen in "
        f"the picture of {picture.size}, and 4 corners not on one line are needed; is it in view and sharp?"
    )
