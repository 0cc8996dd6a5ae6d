"""ChArUco boards: chessboard corners that the markers round them number."""

from __future__ import annotations

import cv2
import numpy as np

from calib.detection.corners import corner_covariances, refine_corners
from calib.detection.detection import Detection
from calib.detection.picture import Picture
from calib.errors import DetectionError
from calib.targets import Charuco, target_points

FEWEST_CORNERS = 4


def detect_charuco(picture: Picture, target: Charuco) -> Detection:
    """Find the inner corners that can be seen, as long as at least 4 of them do not lie on one line."""
