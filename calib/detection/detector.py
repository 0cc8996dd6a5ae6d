"""One call for all kinds of targets."""

from __future__ import annotations

from typing import assert_never

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.aprilgrid import detect_aprilgrid
from calib.detection.charuco import detect_charuco
from calib.detection.chessboard import detect_chessboard
from calib.detection.circle_grid import detect_circle_grid
from calib.detection.detection import Detection
from calib.detection.health import picture_health
from calib.detection.health_in_words import faults
from calib.detection.picture import Picture, read_picture
from calib.errors import DetectionError
from calib.targets import AprilGrid, AsymmetricCircleGrid, Charuco, Chessboard, CircleGrid, NoTarget, Target


def detect(image: NDArray[np.generic], target: Target) -> Detection:
    """Find the target's points in a picture: grey, BGR or BGRA, of 8 or 16 bits.

    The ids are the target's own. A target that looks the same after a turn is read so that its point 0 is the
    one nearest to the picture's top left corner; a mirrored reading is never given.

    Raises DetectionError, in one sentence, where the target is not seen or the array is no picture. What is
    wrong with the picture, and may be why, is in it.
    """
    picture = read_picture(image)
    try:
        return _detect(picture, target)
    except cv2.error as error:
        # OpenCV's finders assert on some pictures in which there is no target.
        raise DetectionError(
            f"the {target.kind} was not found: the search broke off in the picture of {picture.size}; is the "
            f"target in it?{_likely_reason(image, target)}"
        ) from error
    except DetectionError as error:
        raise DetectionError(f"{error}{_likely_reason(image, target)}") from error


def _likely_reason(image: NDArray[np.generic], target: Target) -> str:
    """Say what is wrong with the picture, to be added to a question; nothing where it is good."""
    found = [] if isinstance(target, NoTarget) else faults(picture_health(image, target))
    return f" It may be that {found[0].message}" if found else ""


def _detect(picture: Picture, target: Target) -> Detection:
    match target:
        case CircleGrid() | AsymmetricCircleGrid():
            return detect_circle_grid(picture, target)
        case Chessboard():
            return detect_chessboard(picture, target)
        case Charuco():
            return detect_charuco(picture, target)
        case AprilGrid():
            return detect_aprilgrid(picture, target)
        case NoTarget():
            raise DetectionError("this session has no target to detect: its views carry camera poses")
        case _:
            assert_never(target)
