"""Picture files as they come from cameras, phones and broken copies."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.detection import detect
from calib.errors import DetectionError, ImageError
from calib.picture_file import load_picture
from calib.targets import Chessboard
from tests.calib.detection.drawn_targets import draw

BOARD = Chessboard(rows=6, columns=9, pitch=0.025)


@pytest.fixture(scope="module")
def grey() -> np.ndarray:
    return draw(BOARD, tilt=(20, 10), noise=1).picture


def encoded(picture: np.ndarray, suffix: str) -> bytes:
    return cv2.imencode(suffix, picture)[1].tobytes()


def deep(grey: np.ndarray) -> np.ndarray:
    return grey.astype(np.uint16) * 257


FORMS = {
    "grey.png": lambda grey: grey,
    "colour.png": lambda grey: cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR),
    "alpha.png": lambda grey: cv2.cvtColor(grey, cv2.COLOR_GRAY2BGRA),
    "deep.png": deep,
    "deep-colour.png": lambda grey: cv2.cvtColor(deep(grey), cv2.COLOR_GRAY2BGR),
    "deep.tiff": deep,
    "grey.jpg": lambda grey: grey,
    "colour.jpg": lambda grey: cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR),
    "grey.pgm": lambda grey: grey,
    "grey.bmp": lambda grey: grey,
}


@pytest.mark.parametrize("name", FORMS)
def test_the_target_is_found_in_files_of_all_usual_forms(name: str, grey: np.ndarray, tmp_path: Path) -> None:
    file = tmp_path / name
    file.write_bytes(encoded(FORMS[name](grey), file.suffix))
    within = 0.1 if file.suffix == ".jpg" else 0.02
    assert np.abs(detect(load_picture(file), BOARD).pixels - detect(grey, BOARD).pixels).max() < within


def test_a_picture_of_real_numbers_is_refused_by_the_detector(grey: np.ndarray, tmp_path: Path) -> None:
    file = tmp_path / "real.tiff"
    file.write_bytes(encoded(grey.astype(np.float32), ".tiff"))
    with pytest.raises(DetectionError, match="this one is float32: convert it first"):
        detect(load_picture(file), BOARD)


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.9, 0.999])
def test_a_file_that_is_cut_off_is_refused(
    suffix: str, share: float, grey: np.ndarray, tmp_path: Path
) -> None:
    content = encoded(grey, suffix)
    file = tmp_path / f"cut{suffix}"
    file.write_bytes(content[: int(share * len(content))])
    with pytest.raises(ImageError, match=r"cut\.\w+: (the end of the file is missing|cannot be read)"):
        load_picture(file)


def test_a_jpeg_with_a_whole_thumbnail_and_half_a_picture_is_cut_off(
    grey: np.ndarray, tmp_path: Path
) -> None:
    content, thumbnail = encoded(grey, ".jpg"), encoded(cv2.resize(grey, (64, 48)), ".jpg")
    application = b"\xff\xe1" + (len(thumbnail) + 2).to_bytes(2, "big") + thumbnail
    file = tmp_path / "phone.jpg"
    file.write_bytes(content[:2] + application + content[2:])
    assert load_picture(file).shape[:2] == grey.shape
    file.write_bytes(content[:2] + application + content[2 : len(content) // 2])
    with pytest.raises(ImageError, match="the end of the file is missing"):
        load_picture(file)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "the file is empty"),
        (b"not a picture at all", "cannot be read as a picture"),
        (b"\x89PNG\r\n\x1a\n" + bytes(40) + b"IEND", "cannot be read as a picture"),
        (b"P5 100000 100000 255\n" + bytes(100), "cannot be read as a picture"),
        (bytes(1000), "cannot be read as a picture"),
    ],
    ids=["empty", "text", "damaged", "larger than memory", "zeros"],
)
def test_what_is_no_picture_is_refused(content: bytes, complaint: str, tmp_path: Path) -> None:
    file = tmp_path / "odd.png"
    file.write_bytes(content)
    with pytest.raises(ImageError, match=rf"odd\.png: {complaint}"):
        load_picture(file)


def test_what_is_not_there_is_said(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.png"):
        with pytest.raises(ImageError, match="the picture is missing"):
            load_picture(path)


def test_one_pixel_is_read_and_refused_as_too_small(tmp_path: Path) -> None:
    file = tmp_path / "one.png"
    file.write_bytes(encoded(np.zeros((1, 1), np.uint8), ".png"))
    with pytest.raises(DetectionError, match="1 x 1 px is too small"):
        detect(load_picture(file), BOARD)
