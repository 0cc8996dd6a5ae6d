"""Pictures as JPEG, for people to look at."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import ImageError


def encoded(image: NDArray[Any], width: int | None = None) -> bytes:
    """Return a grey or BGR picture of 8 or 16 bits as JPEG, made smaller where it is wider than `width` px.

    Raises ImageError.
    """
    # JPEG holds 8 bits: of 16, the upper ones are what a person can see.
    shown = (image >> 8).astype(np.uint8) if image.dtype == np.uint16 else image
    if width is not None and width < shown.shape[1]:
        height = max(round(shown.shape[0] * width / shown.shape[1]), 1)
        shown = cv2.resize(shown, (width, height), interpolation=cv2.INTER_AREA)
    done, data = cv2.imencode(".jpg", shown)
    if not done:
        raise ImageError("a picture could not be encoded as JPEG")
    return data.tobytes()
