"""The lens in other programs' hands: OpenCV reads it and sees what we see, and ROS's fields are all there."""

from typing import Any

import cv2
import jsonschema
import numpy as np
import pytest
import yaml

from calib import Calibration
from calib.errors import CalibError
from calib.session import Intrinsics
from daemon.export.yaml_lens import camera_info, lens_notes, opencv_lens
from tests.daemon.export.subjects import LENS, calibration_of, with_lens


def matrix(rows: int, columns: int) -> dict[str, Any]:
    """Return the schema of a matrix as camera_calibration_parsers has it."""
    size = rows * columns
    numbers = {"type": "array", "items": {"type": "number"}, "minItems": size, "maxItems": size}
    return {
        "type": "object",
        "properties": {"rows": {"const": rows}, "cols": {"const": columns}, "data": numbers},
        "required": ["rows", "cols", "data"],
        "additionalProperties": False,
    }


CAMERA_INFO = {
    "type": "object",
    "properties": {
        "image_width": {"type": "integer", "minimum": 1},
        "image_height": {"type": "integer", "minimum": 1},
        "camera_name": {"type": "string"},
        "camera_matrix": matrix(3, 3),
        "distortion_model": {"const": "plumb_bob"},
        "distortion_coefficients": matrix(1, 5),
        "rectification_matrix": matrix(3, 3),
        "projection_matrix": matrix(3, 4),
    },
    "additionalProperties": False,
}
CAMERA_INFO["required"] = list(CAMERA_INFO["properties"])  # type: ignore[call-overload]


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    return with_lens(calibration_of("turntable"))


def test_ros_finds_every_field_with_its_value(calibration: Calibration) -> None:
    said = yaml.safe_load(camera_info(calibration, None))
    jsonschema.validate(said, CAMERA_INFO)
    assert list(said) == CAMERA_INFO["required"]
    assert (said["image_width"], said["image_height"], said["camera_name"]) == (1280, 960, "main")
    matrix = [LENS["fx"], 0, LENS["cx"], 0, LENS["fy"], LENS["cy"], 0, 0, 1]
    assert said["camera_matrix"]["data"] == matrix
    assert said["distortion_coefficients"]["data"] == LENS["distortion"]
    assert said["rectification_matrix"]["data"] == np.eye(3).ravel().tolist()
    projection = np.array(said["projection_matrix"]["data"]).reshape(3, 4)
    np.testing.assert_array_equal(projection, np.column_stack([np.reshape(matrix, (3, 3)), np.zeros(3)]))


def test_opencv_reads_it_and_sees_what_we_see(calibration: Calibration) -> None:
    storage = cv2.FileStorage(
        opencv_lens(calibration, "main"), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY
    )
    intrinsic = storage.getNode("camera_matrix").mat()
    distortion = storage.getNode("distortion_coefficients").mat()
    size = [int(storage.getNode(f"image_{side}").real()) for side in ("width", "height")]
    assert size == [1280, 960]
    points, rng = np.zeros((300, 3)), np.random.default_rng(2)
    points[:, :2] = rng.uniform(-0.05, 0.3, (300, 2))
    pose = calibration.world_from_camera([4.0])
    camera_from_world = np.linalg.inv(pose)
    turn = cv2.Rodrigues(camera_from_world[:3, :3])[0]
    seen = cv2.projectPoints(points, turn, camera_from_world[:3, 3], intrinsic, distortion)[0][:, 0]
    ours = calibration.project(points, [4.0])
    assert np.ptp(ours, axis=0).min() > 300
    np.testing.assert_allclose(seen, ours, atol=1e-6)


def test_another_model_is_converted_and_both_files_say_how_well() -> None:
    calibration = with_lens(calibration_of("turntable"), model="division", distortion=[-0.2])
    [note] = lens_notes(calibration, None)
    assert "of the model 'division': this is the nearest of k1 k2 p1 p2 k3, off by up to 0.0" in note
    for text in (camera_info(calibration, None), opencv_lens(calibration, None)):
        assert f"# {note}\n" in text
    said = yaml.safe_load(camera_info(calibration, None))
    jsonschema.validate(said, CAMERA_INFO)
    ours = Intrinsics.model_validate(LENS | {"model": "division", "distortion": [-0.2]})
    assert said["camera_matrix"]["data"][0] == ours.fx
    assert said["distortion_coefficients"]["data"][0] == pytest.approx(-0.2, abs=0.01)


def test_what_cannot_be_said_is_refused_in_a_sentence() -> None:
    blind = calibration_of("turntable")
    with pytest.raises(CalibError, match="the lens of camera 'main' is not known: its views carried poses"):
        camera_info(blind, None)
    with pytest.raises(CalibError, match="no camera 'left' in this calibration; it has main"):
        opencv_lens(blind, "left")
    nowhere = with_lens(blind, width=None, height=None)
    with pytest.raises(CalibError, match="the size of the pictures of camera 'main' is not known"):
        camera_info(nowhere, None)
    assert "image_width" not in opencv_lens(nowhere, None)


def test_any_name_of_a_camera_is_read_back_as_it_is(calibration: Calibration) -> None:
    for name in ("yes", "12", 'l\'œil: "gauche" # 1', "-"):
        document = calibration.model_dump(mode="json", exclude_unset=True)
        document["cameras"][0]["name"] = name
        assert yaml.safe_load(camera_info(Calibration.model_validate(document), name))["camera_name"] == name
