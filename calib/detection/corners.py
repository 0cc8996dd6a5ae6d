"""Corners measured on the grey values."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.picture import Picture

SMALLEST_WINDOW, LARGEST_WINDOW = 2, 15
SMOOTHING = (
    1.0  # px; differences between neighbouring pixels magnify noise and depend on where the pixels lie
)
SCATTER_OVER_BOUND = 1.6  # seen on drawn corners
UNMODELLED_VARIANCE = 0.025**2  # px²; shading, and where the pixels lie
STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-3)


def refine_corners(
    picture: Picture, pixels: NDArray[np.float64], reaches: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Move corners (n, 2) to where the grey values' gradients point past them (Förstner's operator).

    `reaches` (n,) is how far (px) round each corner nothing but its own edges is to be seen.
    """
    smooth = cv2.GaussianBlur(picture.values, (0, 0), SMOOTHING)
    refined = pixels.astype(np.float32).reshape(-1, 1, 1, 2)
    for corner, half in zip(refined, _half_windows(reaches), strict=True):
        cv2.cornerSubPix(smooth, corner, (int(half), int(half)), (-1, -1), STOP)
    return refined.reshape(-1, 2).astype(np.float64)


def corner_covariances(
    picture: Picture, pixels: NDArray[np.float64], reaches: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Estimate the covariances (n, 2, 2) in px² of measured corners.

    The picture's noise sets a bound, noise² (sum of g gᵀ)⁻¹ over the gradients g of the patch, from which the
    measurement keeps some distance.
    """
    halves = _half_windows(reaches)
    information = np.empty((len(pixels), 2, 2))
    for tensor, centre, half in zip(information, pixels, halves, strict=True):
        patch = cv2.getRectSubPix(
            picture.values, (int(2 * half + 3),) * 2, (float(centre[0]), float(centre[1]))
        )
        along_x = (patch[1:-1, 2:] - patch[1:-1, :-2]) / 2
        along_y = (patch[2:, 1:-1] - patch[:-2, 1:-1]) / 2
        gradients = np.stack([along_x.ravel(), along_y.ravel()]).astype(np.float64)
        tensor[:] = gradients @ gradients.T
    # A patch without any structure knows its place to within the window only.
    information += (picture.noise / halves)[:, None, None] ** 2 * np.eye(2)
    return (SCATTER_OVER_BOUND * picture.noise) ** 2 * np.linalg.inv(
        information
    ) + UNMODELLED_VARIANCE * np.eye(2)


def _half_windows(reaches: NDArray[np.float64]) -> NDArray[np.int64]:
    # The window is a square, and its own corners reach sqrt(2) times as far.
    halves = np.clip(np.floor(reaches / np.sqrt(2)), SMALLEST_WINDOW, LARGEST_WINDOW)
    return np.asarray(halves, dtype=np.int64)
