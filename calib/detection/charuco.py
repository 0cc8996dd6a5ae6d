"""ChArUco boards: corners of a chessboard, numbered by the markers round them."""

from __future__ import annotations

import cv2
import numpy as np

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
    corners, numbers, _, seen = cv2.aruco.CharucoDetector(board).detectBoard(picture.grey)
    # OpenCV says None where there is nothing, whatever the annotation says.
    ids = np.array([] if numbers is None else numbers, dtype=np.int64).ravel()
    rough = np.array([] if corners is None else corners, dtype=np.float64).reshape(-1, 2)
    plane = target_points(target)[ids, :2]
    view = view_of_plane(plane, rough)
    if view is None:
        board_in_words = f"the ChArUco board of {target.rows} x {target.columns} squares"
        markers, times = np.unique(np.array([] if seen is None else seen, np.int64), return_counts=True)
        if np.any(times > 1):
            raise two_prints("marker", board_in_words, markers[times > 1])
        raise DetectionError(
            f"{board_in_words} was not found: {len(ids)} corners and {len(markers)} markers of "
            f"{target.dictionary} were seen in the picture of {picture.size}, and 4 corners not on one line are "
            "needed; is it in view and sharp?"
        )
    clear = (target.pitch - target.marker) / 2
    # OpenCV 4's corners are half a pixel off, which measuring them anew mends.
    pixels, covariances = measure_corners(picture, view, plane, rough, target.pitch, clear)
    order = np.argsort(ids)
    return Detection(ids[order], pixels[order], covariances[order], disk=None)
