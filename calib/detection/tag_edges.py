"""Corners of tags, measured as the crossings of their borders' outer edges.

Blur rounds a corner off, and an operator that looks at the corner alone is pulled inwards, by 0.2 to 0.5 px
under common blur; the straight parts of the edges stay where they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.picture import Picture

MOST_REPEATS = 6
STANDS_STILL = 0.01  # px
SAMPLES_PER_PIXEL = 4
FEWEST_PROFILES, MOST_PROFILES = 8, 64
NEARLY_PARALLEL = 1e-3
UNMODELLED_VARIANCE = 0.025**2  # px²; the print, and cells that blur into the border
LEAST_STRAIGHT = 0.4  # of a side, where keeping clear of its ends would leave less


@dataclass(frozen=True, eq=False)
class _Line:
    """The points p with normal · p = offset, and the variance (px²) of the offset at the edge's ends."""

    normal: NDArray[np.float64]
    offset: float
    variance: float


@dataclass(frozen=True, eq=False)
class TagCorners:
    """A tag's corners: `pixels` (4, 2), clockwise, and their `covariances` (4, 2, 2) in px²."""

    pixels: NDArray[np.float64]
    covariances: NDArray[np.float64]


def refine_tag(picture: Picture, corners: NDArray[np.float64], reach: float) -> TagCorners | None:
    """Move a tag's corners (4, 2), clockwise, to where lines along its edges cross; None without such edges.

    `reach` is how far (px) to both sides of an edge there is only black and only white.
    """
    start = corners
    for _ in range(MOST_REPEATS):
        following = np.roll(corners, -1, axis=0)
        lines = [_edge(picture, a, b, reach) for a, b in zip(corners, following, strict=True)]
        found = [line for line in lines if line is not None]
        if len(found) < len(lines):
            return None
        # Each corner starts its own edge and ends the one before.
        crossings = [_crossing(found[side - 1], found[side]) for side in range(4)]
        before, corners = corners, np.array([pixel for pixel, _ in crossings])
        if not np.abs(corners - start).max() < 2 * reach:
            return None
        if np.abs(corners - before).max() < STANDS_STILL:
            break
    return TagCorners(corners, np.array([covariance for _, covariance in crossings]))


def _edge(
    picture: Picture, start: NDArray[np.float64], end: NDArray[np.float64], reach: float
) -> _Line | None:
    """Fit a line to the edge from black (on the right of start to end) to white (on the left).

    Across the edge, its place is the centroid of the grey values' slope, which blur does not move.
    """
    length = float(np.linalg.norm(end - start))
    if not length > 2 * reach:
        return None
    along = (end - start) / length
    outwards = np.array([along[1], -along[0]])
    margin = min(reach / length, (1 - LEAST_STRAIGHT) / 2)
    profiles = int(np.clip(length, FEWEST_PROFILES, MOST_PROFILES))
    bases = start + np.linspace(margin, 1 - margin, profiles)[:, None] * (end - start)
    steps = np.linspace(-reach, reach, 2 * int(np.ceil(reach * SAMPLES_PER_PIXEL)) + 1)
    x, y = np.moveaxis(bases[:, None] + steps[:, None] * outwards, -1, 0).astype(np.float32)
    values = np.asarray(cv2.remap(picture.values, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
    slopes = np.diff(values.astype(np.float64), axis=1)
    rises = slopes.sum(axis=1)
    clear = rises > 0.5 * np.median(rises)
    if clear.sum() < FEWEST_PROFILES / 2:
        return None
    places = slopes[clear] @ ((steps[:-1] + steps[1:]) / 2) / rises[clear]
    points = bases[clear] + places[:, None] * outwards
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle)[2][1]
    scatter = float(np.square((points - middle) @ normal).sum()) / (len(points) - 2)
    # A line through n evenly spaced points is known to scatter / n at its middle, 4 times that at its ends.
    return _Line(normal, float(normal @ middle), 4 * scatter / len(points))


def _crossing(one: _Line, other: _Line) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find where two lines cross (2,), and the covariance (2, 2) of that."""
    normals = np.array([one.normal, other.normal])
    if abs(np.linalg.det(normals)) < NEARLY_PARALLEL:
        return np.full(2, np.nan), np.full((2, 2), np.nan)
    pixel_from_offsets = np.linalg.inv(normals)
    covariance = pixel_from_offsets @ np.diag([one.variance, other.variance]) @ pixel_from_offsets.T
    return pixel_from_offsets @ [one.offset, other.offset], covariance + UNMODELLED_VARIANCE * np.eye(2)
