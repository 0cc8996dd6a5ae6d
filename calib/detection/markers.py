"""How OpenCV is to search for markers."""

from collections.abc import Iterator

import cv2

WINDOWS = ((13, 13), (3, 23))
"""Widths (px) of the windows whose mean tells black from white, from the least to the most: one is mostly enough."""


def searches() -> Iterator[cv2.aruco.DetectorParameters]:
    """Search ever harder: go on to the next only where markers are missing."""
    parameters = cv2.aruco.DetectorParameters()
    for parameters.adaptiveThreshWinSizeMin, parameters.adaptiveThreshWinSizeMax in WINDOWS:
        yield parameters
