"""The sheet as PNG."""

import struct
import zlib
from math import ceil, floor

import cv2
import numpy as np
from numpy.typing import NDArray

from daemon.errors import PrintError
from daemon.printing.sheet import TEXT_SIZE, Sheet

INCH = 0.0254
MOST_PIXELS = 200_000_000
FONT, FONT_HEIGHT = cv2.FONT_HERSHEY_SIMPLEX, 22
CAPITAL = 0.72
"""How high a capital letter is, of the size of its font."""
AFTER_HEADER = 33
"""Bytes of a PNG's signature and its first chunk."""


def png(sheet: Sheet, dpi: float) -> bytes:
    """Return the sheet as a PNG file of so many pixels an inch, which it says.

    A pixel is as dark as the part of it that has ink. A place (x, y) of the sheet is at pixel x s - 0.5, y s -
    0.5, s pixels a metre, with (0, 0) the centre of the first one. Raises PrintError where that would be more than
    MOST_PIXELS.
    """
    scale = dpi / INCH
    width, height = round(sheet.width * scale), round(sheet.height * scale)
    if not 1 <= width * height <= MOST_PIXELS:
        raise PrintError(
            f"at {dpi:g} dpi the picture would have {width} x {height} pixels: choose another --dpi, or a PDF"
        )
    ink = np.zeros((height, width), dtype=np.float32)
    for x, y, w, h in (scale * sheet.ink.rectangles).tolist():
        (rows, down), (columns, across) = _overlap(y, y + h, height), _overlap(x, x + w, width)
        ink[rows, columns] += np.outer(down, across)
    for x, y, diameter in (scale * sheet.ink.disks).tolist():
        _add_disk(ink, x, y, diameter / 2)
    picture = np.rint(255 * (1 - np.clip(ink, 0, 1))).astype(np.uint8)
    size = CAPITAL * TEXT_SIZE * scale / FONT_HEIGHT
    for text in sheet.texts:
        at = (round(text.x * scale), round(text.y * scale))
        cv2.putText(picture, text.words, at, FONT, size, (255,), max(1, round(1.5 * size)), cv2.LINE_AA)
    return _with_resolution(cv2.imencode(".png", picture)[1].tobytes(), scale)


def _overlap(first: float, last: float, count: int) -> tuple[slice, NDArray[np.float64]]:
    """Return the pixels of a row of `count` that the stretch from first to last touches, and how much of each."""
    window = slice(max(floor(first), 0), min(ceil(last), count))
    pixel = np.arange(window.start, window.stop)
    return window, np.clip(np.minimum(pixel + 1, last) - np.maximum(pixel, first), 0, 1)


def _add_disk(ink: NDArray[np.float32], x: float, y: float, radius: float) -> None:
    """Darken pixels by how far their centres are within the disk's edge."""
    rows, columns = (
        np.arange(max(floor(middle - radius) - 1, 0), min(ceil(middle + radius) + 1, count))
        for middle, count in zip((y, x), ink.shape, strict=True)
    )
    depth = radius - np.hypot(columns + 0.5 - x, rows[:, None] + 0.5 - y)
    ink[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] += np.clip(depth + 0.5, 0, 1)


def _with_resolution(file: bytes, pixels_a_metre: float) -> bytes:
    """Add the chunk `pHYs` to a PNG, which OpenCV does not write."""
    resolution = round(pixels_a_metre)
    body = b"pHYs" + struct.pack(">IIB", resolution, resolution, 1)
    chunk = struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))
    return file[:AFTER_HEADER] + chunk + file[AFTER_HEADER:]
