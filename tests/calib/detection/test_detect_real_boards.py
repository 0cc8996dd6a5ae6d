"""Chessboards photographed by others, found in every picture and good enough for the known lens."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.detection import detect
from calib.targets import Chessboard, target_points

NACHI = Chessboard(rows=8, columns=11, pitch=0.015)
LEFT = Chessboard(rows=6, columns=9, pitch=0.025)


def pictures(folder: str) -> list[np.ndarray]:
    root = Path(__file__).parents[3]
    frames = Path(os.environ.get("ACTIVECAM_DATA", root.parent / "shared" / "data")) / folder / "frames"
    if not frames.is_dir():
        pytest.skip(
            f"the real measurements are not at hand: set ACTIVECAM_DATA to the folder that holds {folder}"
        )
    return [cv2.imread(str(path)) for path in sorted(frames.iterdir())]


def calibrated(target: Chessboard, images: list[np.ndarray]) -> tuple[float, np.ndarray]:
    """Return the rms (px) and the camera matrix of OpenCV's fit to every picture."""
    points = target_points(target).astype(np.float32)
    pixels = [detect(image, target).pixels.astype(np.float32) for image in images]
    size = images[0].shape[1::-1]
    rms, K, *_ = cv2.calibrateCamera([points] * len(pixels), pixels, size, None, None)
    return rms, K


def test_the_board_is_found_in_all_pictures_of_the_robots_camera():
    images = pictures("nachi0117")
    assert len(images) == 24
    rms, _ = calibrated(NACHI, images)
    assert rms < 0.06


def test_the_board_is_found_in_all_of_opencvs_own_pictures():
    images = pictures("opencv-left")
    assert len(images) == 13
    rms, K = calibrated(LEFT, images)
    assert rms < 0.17
    assert K[0, 0] == pytest.approx(535.92, rel=0.01)
    assert K[1, 1] == pytest.approx(535.92, rel=0.01)


def test_the_board_of_the_standard_picture_is_numbered_from_its_black_corner():
    upright = detect(pictures("opencv-left")[0], LEFT)
    np.testing.assert_allclose(upright.pixels[0], [244, 94], atol=1.5)
    along_columns = upright.pixels[1] - upright.pixels[0]
    assert along_columns[0] > abs(along_columns[1])
