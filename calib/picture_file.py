"""A picture as it is on disk: read whole, or refused in words."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import ImageError

PNG, JPEG = b"\x89PNG", b"\xff\xd8"


def load_picture(path: Path) -> NDArray[np.generic]:
    """Return the grey or BGR(A) values of the file, at its own depth.

    Raises ImageError where it is missing, empty, cut off or no picture.
    """
    if not path.is_file():
        raise ImageError(f"{path}: the picture is missing: check its name, or put it back")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ImageError(f"{path}: cannot be read: {error.strerror}") from error
    if not content:
        raise ImageError(f"{path}: the file is empty: copy or take the picture again")
    if _cut_off(content):
        # Decoders fill in grey what is missing, and say nothing.
        raise ImageError(f"{path}: the end of the file is missing: copy or take the picture again")
    try:
        picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise ImageError(f"{path}: cannot be read as a picture ({error.err})") from error
    # OpenCV returns None for what is no picture, whatever the annotation says.
    if not isinstance(picture, np.ndarray):
        raise ImageError(f"{path}: cannot be read as a picture: save it as PNG, JPEG or TIFF")
    return picture


def _cut_off(content: bytes) -> bool:
    if content.startswith(PNG):
        return b"IEND" not in content
    # Its end mark stands after the last scan; a thumbnail's own stands before.
    return content.startswith(JPEG) and content.rfind(b"\xff\xd9") < content.rfind(b"\xff\xda")
