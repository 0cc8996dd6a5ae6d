"""Which arrays are pictures, and what is said of those in which there is no target."""

from itertools import product

import cv2
import numpy as np
import pytest
from drawn_targets import draw

from calib.detection import detect
from calib.errors import DetectionError
from calib.targets import AprilGrid, AsymmetricCircleGrid, Charuco, Chessboard, CircleGrid, NoTarget

CIRCLES = CircleGrid(rows=6, columns=7, pitch=0.03, disk_diameter=0.018)
CHESSBOARD = Chessboard(rows=6, columns=9, pitch=0.025)
CHARUCO = Charuco(rows=5, columns=7, pitch=0.03, marker=0.021, dictionary="DICT_5X5_100")
ALL = [
    CIRCLES,
    AsymmetricCircleGrid(rows=7, columns=4, pitch=0.04, disk_diameter=0.016),
    CHESSBOARD,
    CHARUCO,
    AprilGrid(rows=4, columns=5, tag=0.03, spacing=0.009),
]
KINDS = [target.kind for target in ALL]


@pytest.mark.parametrize("target", ALL, ids=KINDS)
@pytest.mark.parametrize(
    ("take", "within"),
    [
        pytest.param(lambda grey: grey[:, :, None], 1e-9, id="one channel"),
        pytest.param(lambda grey: cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), 1e-9, id="BGR"),
        pytest.param(lambda grey: cv2.cvtColor(grey, cv2.COLOR_GRAY2BGRA), 1e-9, id="BGRA"),
        pytest.param(lambda grey: grey.astype(np.uint16) * 257, 0.02, id="16 bits"),
        pytest.param(lambda grey: grey.astype(np.uint16) * 16, 0.02, id="12 bits in 16"),
        pytest.param(lambda grey: (grey.astype(np.uint16) * 257).astype(">u2"), 0.02, id="other byte order"),
        pytest.param(np.asfortranarray, 1e-9, id="by columns"),
        pytest.param(lambda grey: grey // 6, 0.2, id="under-exposed"),
    ],
)
def test_a_picture_may_come_in_any_usual_form(target, take, within):
    grey = draw(target, tilt=(20, 10), fill=0.6, noise=1).picture
    expected = detect(grey, target)
    detection = detect(take(grey), target)
    np.testing.assert_array_equal(detection.ids, expected.ids)
    assert np.abs(detection.pixels - expected.pixels).max() < within


def test_the_picture_is_left_as_it_was():
    picture = draw(CHESSBOARD).picture
    before = picture.copy()
    picture.flags.writeable = False
    detect(picture, CHESSBOARD)
    np.testing.assert_array_equal(picture, before)


@pytest.mark.parametrize(
    ("image", "complaint"),
    [
        (np.zeros((1, 1), np.uint8), "1 x 1 px is too small"),
        (np.zeros((0, 640), np.uint8), "640 x 0 px is too small"),
        (np.zeros((0, 0, 3), np.uint16), "0 x 0 px is too small"),
        (np.zeros((480,), np.uint8), r"this array is \(480,\)"),
        (np.zeros((480, 640, 2), np.uint8), r"this array is \(480, 640, 2\)"),
        (np.zeros((1, 480, 640, 3), np.uint8), r"this array is \(1, 480, 640, 3\)"),
        (np.zeros((480, 640), np.float64), "this one is float64: convert it"),
        (np.zeros((480, 640), bool), "this one is bool: convert it"),
        (np.zeros((480, 640), np.int32), "this one is int32: convert it"),
        (None, "no picture to look at"),
        ([[0, 1], [1, 0]], "no picture to look at"),
        (np.zeros((480, 640), np.uint8), "every pixel has the grey value 0"),
        (np.full((480, 640, 3), 255, np.uint8), "every pixel has the grey value 255"),
    ],
)
def test_an_array_that_is_no_picture_is_refused_in_a_sentence(image, complaint):
    with pytest.raises(DetectionError, match=complaint):
        detect(image, CHESSBOARD)


def nothing_to_see(name: str) -> np.ndarray:
    rng = np.random.default_rng(1)
    noise = rng.integers(0, 256, (240, 320), np.uint8)
    match name:
        case "noise":
            return noise
        case "clouds":
            return cv2.GaussianBlur(noise, (0, 0), 5)
        case "ramp":
            return np.tile(np.linspace(0, 255, 320).astype(np.uint8), (240, 1))
        case "one bright pixel":
            picture = np.zeros((240, 320), np.uint8)
            picture[100, 100] = 255
            return picture
        case "smallest":
            return noise[:32, :32]
        case "one line":
            return noise[:32]
    raise AssertionError(name)


@pytest.mark.parametrize("scene", ["noise", "clouds", "ramp", "one bright pixel", "smallest", "one line"])
@pytest.mark.parametrize("target", ALL, ids=KINDS)
def test_a_picture_of_nothing_is_said_to_hold_no_target(target, scene):
    with pytest.raises(DetectionError, match="found"):
        detect(nothing_to_see(scene), target)


@pytest.mark.parametrize(
    ("target", "shown"),
    [
        pytest.param(target, shown, id=f"{target.kind} in the picture of {shown.kind}")
        for target, shown in product(ALL, ALL)
        if target is not shown
    ],
)
def test_a_target_of_another_kind_is_not_taken_for_it(target, shown):
    with pytest.raises(DetectionError, match="found"):
        detect(draw(shown, fill=0.6, tilt=(15, 10)).picture, target)


@pytest.mark.parametrize("target", ALL[:3], ids=KINDS[:3])
def test_a_grid_partly_out_of_view_is_not_found(target):
    with pytest.raises(DetectionError, match=f"{target.rows} x {target.columns}.*whole"):
        detect(draw(target, fill=0.7, shift=(300, 0)).picture, target)


def test_a_grid_of_other_numbers_is_not_taken_for_the_target():
    picture = draw(CircleGrid(rows=6, columns=6, pitch=0.03, disk_diameter=0.018), fill=0.6).picture
    with pytest.raises(DetectionError, match="at most 36 blobs were seen together"):
        detect(picture, CIRCLES)


def test_three_corners_of_a_charuco_board_are_not_enough():
    drawn = draw(CHARUCO, fill=0.6)
    picture = drawn.picture.copy()
    picture[:, int(drawn.points[1, 0]) - 10 :] = 225
    with pytest.raises(DetectionError, match="4 corners not on one line are needed"):
        detect(picture, CHARUCO)


def test_a_session_without_a_target_has_nothing_to_detect():
    with pytest.raises(DetectionError, match="no target to detect"):
        detect(draw(CHESSBOARD).picture, NoTarget())
