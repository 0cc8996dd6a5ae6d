"""The pixels along straight edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.detection.picture import Picture

Floats = NDArray[np.float64]

MOST_ACROSS = 96  # lines of pixels across an edge; of more than that, every second, third... is taken


def strips(
    picture: Picture, starts: Floats, ends: Floats, width: float
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Give the pixels (e, m, 2) within `width` px of each edge from start to end (e, 2), and which count (e, m).

    They are whole lines of pixels, along x or y, whichever crosses the edge more steeply: nothing is
    interpolated, and each pixel comes once. Pixels out of the picture do not count.
    """
    direction = ends - starts
    steep = np.abs(direction[:, 1]) > np.abs(direction[:, 0])
    # Steep edges are treated as lying ones, with x and y exchanged.
    first, last = (np.where(steep[:, None], points[:, ::-1], points) for points in (starts, ends))
    first, last = (np.where((first[:, :1] <= last[:, :1]), *pair) for pair in ((first, last), (last, first)))
    low, high = np.ceil(first[:, 0]), np.floor(last[:, 0])
    count = int(max((high - low).max(initial=0.0), 0.0)) + 1
    stride = -(-count // MOST_ACROSS)
    along = low[:, None] + stride * np.arange(-(-count // stride))
    slope = (last[:, 1] - first[:, 1]) / np.maximum(last[:, 0] - first[:, 0], 1e-9)
    middle = first[:, 1, None] + slope[:, None] * (along - first[:, :1])
    half = int(np.ceil(width * np.sqrt(2)))
    across = np.rint(middle)[..., None] + np.arange(-half, half + 1)
    distance = np.abs(across - middle[..., None]) / np.sqrt(1 + slope**2)[:, None, None]
    used = (distance <= width) & (along <= high[:, None])[..., None]
    along = np.broadcast_to(along[..., None], across.shape)
    pixels = np.where(
        steep[:, None, None, None], np.stack([across, along], -1), np.stack([along, across], -1)
    )
    pixels = pixels.reshape(len(starts), -1, 2)
    size = np.array(picture.values.shape[::-1])
    inside = ((pixels >= 0) & (pixels < size)).all(axis=-1)
    return np.clip(pixels, 0, size - 1).astype(np.int64), used.reshape(len(starts), -1) & inside
