"""A camera's lens for those who ask for YAML: ROS, and OpenCV."""

import json

import cv2
import numpy as np
from numpy.typing import NDArray

from calib import Calibration
from calib.errors import CalibError
from calib.plumb_bob import PlumbBob, plumb_bob
from calib.session import Intrinsics


def camera_info(calibration: Calibration, camera: str | None) -> str:
    """Return a camera's lens as ROS's camera_calibration_parsers writes and reads it.

    Nothing is rectified: the rectification is the identity, and the projection that of the picture as it is. Raises
    CalibError where the lens is not known, or cannot be said so.
    """
    name, lens, said = _lens(calibration, camera)
    if lens.width is None or lens.height is None:
        raise CalibError(f"the size of the pictures of camera '{name}' is not known, and ROS asks for it")
    projection = np.column_stack([said.matrix, np.zeros(3)])
    return "\n".join(
        [
            *(f"# {sentence}" for sentence in lens_notes(calibration, camera)),
            f"image_width: {lens.width}",
            f"image_height: {lens.height}",
            f"camera_name: {json.dumps(name, ensure_ascii=False)}",
            *_matrix("camera_matrix", said.matrix),
            "distortion_model: plumb_bob",
            *_matrix("distortion_coefficients", said.distortion[None]),
            *_matrix("rectification_matrix", np.eye(3)),
            *_matrix("projection_matrix", projection),
            "",
        ]
    )


def opencv_lens(calibration: Calibration, camera: str | None) -> str:
    """Return a camera's lens as OpenCV's `cv::FileStorage` reads it, under the names of its calibration sample.

    Raises CalibError where the lens is not known, or cannot be said so.
    """
    name, lens, said = _lens(calibration, camera)
    storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    for sentence in lens_notes(calibration, camera):
        storage.writeComment(sentence)
    storage.write("camera_name", name)
    if lens.width is not None and lens.height is not None:
        storage.write("image_width", lens.width)
        storage.write("image_height", lens.height)
    storage.write("camera_matrix", said.matrix)
    storage.write("distortion_coefficients", said.distortion[None])
    if calibration.quality.rms_px is not None:
        storage.write("avg_reprojection_error", calibration.quality.rms_px)
    return str(storage.releaseAndGetString())


def lens_notes(calibration: Calibration, camera: str | None) -> list[str]:
    """Return sentences on what is lost where a lens is taken for a plumb bob; raises CalibError as the files do."""
    name, lens, said = _lens(calibration, camera)
    if lens.model == "opencv":
        return []
    return [
        f"the lens of camera '{name}' is of the model '{lens.model}': "
        f"this is the nearest of k1 k2 p1 p2 k3, off by up to {said.off_px:.2g} px in the picture"
    ]


def _lens(calibration: Calibration, camera: str | None) -> tuple[str, Intrinsics, PlumbBob]:
    found = calibration.cameras[calibration.camera_index(camera)]
    if found.intrinsics is None:
        raise CalibError(
            f"the lens of camera '{found.name}' is not known: its views carried poses, not points"
        )
    return found.name, found.intrinsics, plumb_bob(found.intrinsics, found.name)


def _matrix(key: str, matrix: NDArray[np.float64]) -> list[str]:
    rows, columns = matrix.shape
    numbers = ", ".join(map(_number, matrix.ravel().tolist()))
    return [f"{key}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: [{numbers}]"]


def _number(value: float) -> str:
    """Return a number that every YAML takes for one: 1e-05 is a word to those who go by version 1.1."""
    text = repr(float(value))
    return text if "." in text else text.replace("e", ".0e")
