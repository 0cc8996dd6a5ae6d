"""OpenCV's own detectors, by kind of target and each as its documentation has it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.rendered_plates import Printed
from benchmarks.true_rig import Array
from calib.targets import AprilGrid, AsymmetricCircleGrid, Charuco, Chessboard, CircleGrid

SUB_PIXEL: Final = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.001)
WINDOW: Final = (5, 5)

Picture = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Found:
    """What a detector says: pixels (n, 2), and ids (n,) and covariances (n, 2, 2) where it knows any."""

    pixels: Array
    ids: NDArray[np.int64] | None = None
    covariances: Array | None = None


Detector = Callable[[Picture], Found | None]


def peers(target: Printed) -> Mapping[str, Detector]:
    """Return OpenCV's detectors of this target by name."""
    match target:
        case CircleGrid() | AsymmetricCircleGrid():
            return {"findCirclesGrid": partial(_circles, target=target)}
        case Chessboard():
            return {
                "findChessboardCornersSB": partial(_sectors, target=target),
                "findChessboardCorners": partial(_quadrangles, target=target),
            }
        case Charuco():
            return {"CharucoDetector": partial(_charuco, detector=_charuco_detector(target))}
        case AprilGrid():
            return {"ArucoDetector": partial(_tags, target=target, detector=_tag_detector(target))}


def _circles(picture: Picture, target: CircleGrid | AsymmetricCircleGrid) -> Found | None:
    symmetric = isinstance(target, CircleGrid)
    shape = cv2.CALIB_CB_SYMMETRIC_GRID if symmetric else cv2.CALIB_CB_ASYMMETRIC_GRID
    parameters = cv2.SimpleBlobDetector.Params()
    # Its own limit, 5000 px, is a disk 80 px wide.
    parameters.maxArea = picture.size / (target.rows * target.columns)
    blobs = cv2.SimpleBlobDetector.create(parameters)
    return _whole(
        *cv2.findCirclesGrid(picture, (target.columns, target.rows), flags=shape, blobDetector=blobs)
    )


def _sectors(picture: Picture, target: Chessboard) -> Found | None:
    return _whole(*cv2.findChessboardCornersSB(picture, (target.columns, target.rows)))


def _quadrangles(picture: Picture, target: Chessboard) -> Found | None:
    found, corners = cv2.findChessboardCorners(picture, (target.columns, target.rows))
    if found:
        corners = cv2.cornerSubPix(picture, corners, WINDOW, (-1, -1), SUB_PIXEL)
    return _whole(found, corners)


def _whole(found: bool, pixels: cv2.typing.MatLike) -> Found | None:
    return Found(np.asarray(pixels, float).reshape(-1, 2)) if found else None


def _charuco_detector(target: Charuco) -> cv2.aruco.CharucoDetector:
    shape = (target.columns, target.rows)
    board = cv2.aruco.CharucoBoard(shape, target.pitch, target.marker, _dictionary(target.dictionary))
    return cv2.aruco.CharucoDetector(board)


def _charuco(picture: Picture, detector: cv2.aruco.CharucoDetector) -> Found | None:
    corners, ids, _, _ = detector.detectBoard(picture)
    if ids is None or not len(ids):
        return None
    return Found(np.asarray(corners, float).reshape(-1, 2), np.asarray(ids, np.int64).ravel())


def _tag_detector(target: AprilGrid) -> cv2.aruco.ArucoDetector:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    return cv2.aruco.ArucoDetector(_dictionary(target.dictionary), parameters)


def _tags(picture: Picture, target: AprilGrid, detector: cv2.aruco.ArucoDetector) -> Found | None:
    corners, tags, _ = detector.detectMarkers(picture)
    if tags is None or not len(tags):
        return None
    ids = (4 * np.asarray(tags, np.int64).reshape(-1, 1) + np.arange(4)).ravel()
    pixels = np.asarray(corners, float).reshape(-1, 2)
    ours = ids < 4 * target.rows * target.columns
    return Found(pixels[ours], ids[ours])


def _dictionary(name: str) -> cv2.aruco.Dictionary:
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
