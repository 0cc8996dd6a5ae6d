"""How good a picture is to measure in, in numbers: light, edges, and how the target lies in it."""

from __future__ import annotations

from dataclasses import dataclass
from math import acos

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.detection import Detection
from calib.detection.edges import REACH, Edges, measure_edges, sample_of
from calib.detection.picture import grey_values, noise_of, samples_apart
from calib.detection.plane import PlaneView, view_of_plane
from calib.targets import (
    AprilGrid,
    AsymmetricCircleGrid,
    Charuco,
    CircleGrid,
    NoTarget,
    Target,
    marker_cells,
    target_points,
)

SATURATED = 0.995  # of the full scale
FULL_SCALES = (1023, 4095, 16383, 65535)
CELL = 16  # px at least: the picture is looked over for saturated patches in cells of this size
MOST_CELLS = 40  # a side of the picture
SATURATED_CELL = 0.25  # of its pixels

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Exposure:
    """The light in the target's region of the picture, or in all of it where no target was found.

    `ink` and `paper` are the grey values of the darkest and the brightest, but for 2 % of the target's region or
    0.1 % of the whole picture, as shares of the full scale; `noise` is their standard deviation, likewise. A
    camera of more than 8 bits is taken to have 10, 12, 14 or 16: the fewest that hold the brightest pixel.
    `saturated` is the share of pixels at the full scale.
    """

    ink: float
    paper: float
    noise: float
    saturated: float


@dataclass(frozen=True)
class Glare:
    """The largest patch that is saturated: its middle (px), its size (px), and how much of the region it is."""

    x: float
    y: float
    width: float
    height: float
    share: float


@dataclass(frozen=True)
class TargetInPicture:
    """How the target lies in the picture.

    `points` were found of `of`; `outside` of them lie beyond the picture's border by where the others are.
    `area` is the share of the picture that the points span, `element_px` how wide the target's finest
    `element` is where it is seen smallest, `border_px` how far the nearest found point is from the picture's
    border, `tilt` (rad) the angle between target and image plane, by how much the target is foreshortened in its
    middle: rough far from the picture's middle, where lines of sight are oblique. None where the points
    do not span a plane.
    """

    points: int
    of: int
    outside: int | None
    area: float
    element: str
    element_px: float | None
    border_px: float
    tilt: float | None


@dataclass(frozen=True)
class PictureHealth:
    """How good a picture is to measure in. `edges` is None where nothing stands out from the noise."""

    width: int
    height: int
    exposure: Exposure
    edges: Edges | None
    glare: Glare | None
    target: TargetInPicture | None


def picture_health(
    image: NDArray[np.generic], target: Target, detection: Detection | None = None
) -> PictureHealth:
    """Measure a picture as `detect` takes it, and what was found in it of the target, if anything.

    Raises DetectionError where the array is no picture.
    """
    values = grey_values(image)
    height, width = values.shape
    noise = noise_of(values, samples_apart(values))
    full = 255 if values.dtype == np.uint8 else next(scale for scale in FULL_SCALES if values.max() <= scale)
    seen, region, reach = None, None, REACH
    if detection is not None and len(detection.ids):
        seen = _seen(target, detection, (width, height))
        region = _hull(detection.pixels, values.shape)
        if seen.element_px is not None:
            reach = float(np.clip(seen.element_px, 3.0, REACH))
    saturated = values >= SATURATED * full
    return PictureHealth(
        width=width,
        height=height,
        exposure=_exposure(values, noise, full, saturated, region),
        edges=measure_edges(values, noise, region, reach),
        glare=_glare(saturated, region),
        target=seen,
    )


def _exposure(
    values: NDArray[np.uint8 | np.uint16],
    noise: float,
    full: int,
    saturated: NDArray[np.bool_],
    region: NDArray[np.bool_] | None,
) -> Exposure:
    # A target that was not found may be a small part of the picture.
    rest = 0.1 if region is None else 2.0
    ink, paper = np.percentile(sample_of(values, region), (rest, 100 - rest)) / full
    share = (
        saturated.mean()
        if region is None
        else np.count_nonzero(saturated & region) / np.count_nonzero(region)
    )
    return Exposure(float(ink), float(paper), noise / full, float(share))


def _glare(saturated: NDArray[np.bool_], region: NDArray[np.bool_] | None) -> Glare | None:
    """Find the largest patch of neighbouring cells with many saturated pixels."""
    if not saturated.any():
        return None
    height, width = saturated.shape
    size = max(CELL, -(-max(height, width) // MOST_CELLS))
    columns, rows = max(width // size, 1), max(height // size, 1)
    considered = np.ones((rows, columns), dtype=bool)
    if region is not None:
        saturated = saturated & region
        considered = _shares(region, columns, rows) > SATURATED_CELL
    full = (_shares(saturated, columns, rows) > SATURATED_CELL).astype(np.uint8)
    count, _, patches, middles = cv2.connectedComponentsWithStats(full, connectivity=4)
    if count < 2:
        return None
    largest = 1 + int(np.argmax(patches[1:, cv2.CC_STAT_AREA]))
    across, down = width / columns, height / rows
    return Glare(
        x=float((middles[largest, 0] + 0.5) * across - 0.5),
        y=float((middles[largest, 1] + 0.5) * down - 0.5),
        width=float(patches[largest, cv2.CC_STAT_WIDTH] * across),
        height=float(patches[largest, cv2.CC_STAT_HEIGHT] * down),
        share=float(patches[largest, cv2.CC_STAT_AREA] / max(considered.sum(), 1)),
    )


def _shares(mask: NDArray[np.bool_], columns: int, rows: int) -> Array:
    """Return the share (rows, columns) of each cell's pixels that are in `mask` (h, w)."""
    shares = cv2.resize(mask.astype(np.float32), (columns, rows), interpolation=cv2.INTER_AREA)
    return np.asarray(shares, dtype=np.float64)


def _hull(pixels: Array, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return the pixels (h, w) between the points (n, 2)."""
    mask = np.zeros(shape, dtype=np.uint8)
    inside = np.clip(np.rint(pixels), 0, np.array(shape[::-1]) - 1)
    cv2.fillConvexPoly(mask, cv2.convexHull(inside.astype(np.int32)), 1)
    return mask.astype(bool)


def _seen(target: Target, detection: Detection, size: tuple[int, int]) -> TargetInPicture:
    points = target_points(target)[:, :2]
    found, pixels = points[detection.ids], detection.pixels
    last = np.array(size, dtype=np.float64) - 1
    element, length = _finest(target)
    view = view_of_plane(found, pixels)
    outside = element_px = tilt = None
    if view is not None:
        expected = view.project(points)
        outside = int(((expected < 0) | (expected > last)).any(axis=1).sum())
        element_px = float(length * view.scales(found).min())
        tilt = tilt_of(view, found.mean(axis=0))
    area = cv2.contourArea(cv2.convexHull(pixels.astype(np.float32))) / (size[0] * size[1])
    border = float(min(pixels.min(), (last - pixels).min()))
    return TargetInPicture(len(pixels), len(points), outside, float(area), element, element_px, border, tilt)


def tilt_of(view: PlaneView, middle: Array) -> float:
    """Return the angle (rad) to the image plane that foreshortens a plane at `middle` (2,) as much."""
    long, short = np.linalg.svd(view.jacobians(middle[None])[0], compute_uv=False)
    return acos(min(short / long, 1.0))


def _finest(target: Target) -> tuple[str, float]:
    """Return what has to be resolved to find the target, and its width (m)."""
    match target:
        case CircleGrid() | AsymmetricCircleGrid():
            return "disk", target.disk_diameter
        case Charuco():
            return "marker cell", target.marker / marker_cells(target.dictionary)
        case AprilGrid():
            return "marker cell", target.tag / marker_cells(target.dictionary)
        case NoTarget():
            raise ValueError("a session without a target has no picture of it")
        case _:
            return "square", target.pitch
