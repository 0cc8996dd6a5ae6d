"""Grids of disks, symmetric and asymmetric: found as blobs, put in order, and measured."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.detection import Detection
from calib.detection.disks import Disks, disk_centroids
from calib.detection.labelling import is_mirrored, upright
from calib.detection.ordering import patterns
from calib.detection.picture import Picture, in_original
from calib.detection.plane import view_of_plane
from calib.errors import DetectionError
from calib.targets import AsymmetricCircleGrid, CircleGrid, target_points

SEARCHED_SIDES = 480, 2000  # px; disks that are too small in the first copy are looked for in the second
LARGEST_MISFIT = (
    0.25  # of the distance between disks: more than a lens bends a grid, less than a wrong order does
)
LARGEST_DISK = 3.0  # times as large as all would be if they filled the picture; what is nearer is larger
MOST_APART = 1.8  # spacings, of disks seen at a slant, whose size is between their length and their width
MOST_UNLIKE = 1.6  # times as large as its neighbour
LEAST_RIM, ROOM_FOR_BLUR = 0.5, 8.0  # radii, px: more paper than this round a disk adds nothing but noise
NEIGHBOURS = 9  # of a blob, itself included, that may be linked to it

AnyCircleGrid = CircleGrid | AsymmetricCircleGrid


@dataclass(frozen=True, eq=False)
class _Blobs:
    """Blobs of one colour in a copy of the picture, `scale` times as large: `centres` (n, 2) and `sizes` (n,) in px."""

    light: bool
    scale: float
    centres: NDArray[np.float32]
    sizes: NDArray[np.float32]


def detect_circle_grid(picture: Picture, target: AnyCircleGrid) -> Detection:
    """Find all disks, dark on light or light on dark; raises DetectionError where any is missing."""
    most_together, larger = 0, False
    for blobs in _blobs(picture.grey, target):
        for centres in _neighbourhoods(blobs, target):
            most_together = max(most_together, len(centres))
            if len(centres) < target.rows * target.columns:
                break
            grids = _grids(in_original(centres.astype(np.float64), blobs.scale), target)
            if len(grids) > 1:
                larger = True
            elif grids:
                detection = _measured(picture, target, grids[0], blobs.light)
                if detection is not None:
                    return detection
    name = f"the {target.rows} x {target.columns} {target.kind.replace('_', ' ')}"
    if larger:
        raise DetectionError(
            f"{name} was not found, but disks in more rows or columns: are there as many in the target?"
        )
    raise DetectionError(
        f"{name} was not found: at most {most_together} blobs were seen together in the picture of "
        f"{picture.size}, and it has {target.rows * target.columns} disks; is the whole target in it, sharp, "
        "evenly lit and with disks of the given size?"
    )


def _blobs(grey: NDArray[np.uint8], target: AnyCircleGrid) -> Iterator[_Blobs]:
    """Look for blobs, in a copy that is quick to search first."""
    for side in SEARCHED_SIDES:
        scale = min(side / max(grey.shape), 1.0)
        searched = grey
        if scale < 1:
            searched = np.asarray(cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA))
        calm = cv2.GaussianBlur(searched, (3, 3), 0)  # noise frays outlines
        for light in (False, True):
            found = _blob_detector(searched.size, target, light).detect(calm)
            centres = np.array([blob.pt for blob in found], dtype=np.float32).reshape(-1, 2)
            yield _Blobs(light, scale, centres, np.array([blob.size for blob in found], dtype=np.float32))
        if scale == 1:
            return


def _neighbourhoods(blobs: _Blobs, target: AnyCircleGrid) -> Iterator[NDArray[np.float32]]:
    """Give the centres of blobs that lie together as a grid's disks do: each near others that are about as large.

    The most come first. Letters and noise are neither of its disks' size nor at their distance.
    """
    count = len(blobs.centres)
    if count < 2:
        return
    # Heavy to import, and a daemon that serves poses looks for no disks.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    farthest = MOST_APART * target.spacing / target.disk_diameter
    apart, other = (
        np.asarray(each) for each in cKDTree(blobs.centres).query(blobs.centres, k=min(NEIGHBOURS, count))
    )
    sizes, others = blobs.sizes[:, None], blobs.sizes[other]
    smaller = np.minimum(sizes, others)
    linked = (apart < farthest * smaller) & (np.maximum(sizes, others) < MOST_UNLIKE * smaller)
    row = np.nonzero(linked)[0]
    links = coo_array((np.ones(len(row)), (row, other[linked])), shape=(count, count))
    parts, part = connected_components(links, directed=False)
    for number in np.argsort(-np.bincount(part, minlength=parts)):
        yield blobs.centres[part == number]


def _blob_detector(pixels: int, target: AnyCircleGrid, light: bool) -> cv2.SimpleBlobDetector:
    inked = np.pi / 4 * (target.disk_diameter / target.spacing) ** 2
    parameters = cv2.SimpleBlobDetector.Params()
    parameters.blobColor = 255 if light else 0
    parameters.minThreshold, parameters.maxThreshold, parameters.thresholdStep = 20, 240, 25
    # A larger thing is not merely useless: OpenCV takes a disk within its radius for the same blob.
    parameters.minArea = 12
    parameters.maxArea = LARGEST_DISK * inked * pixels / (target.rows * target.columns)
    parameters.minDistBetweenBlobs = 3
    parameters.filterByConvexity, parameters.minConvexity = True, 0.85
    parameters.filterByInertia, parameters.minInertiaRatio = True, 0.1
    return cv2.SimpleBlobDetector.create(parameters)


def _grids(centres: NDArray[np.float64], target: AnyCircleGrid) -> list[NDArray[np.float64]]:
    """Look for grids among the centres (n, 2): of each the disks (n, 2) in the target's order.

    They are seen from the target's front wherever any order of them is.
    """
    row, column = (each.ravel() for each in np.indices((target.rows, target.columns)))
    if isinstance(target, AsymmetricCircleGrid):
        # Its lattice is that of the diagonals.
        across = 2 * column + row % 2
        row, column = (across + row) // 2, (across - row) // 2
    by_disks: dict[frozenset[int], NDArray[np.float64]] = {}
    for reading in patterns(centres, np.column_stack([column, row])):
        disks = frozenset(reading.tolist())
        grid = centres[reading]
        if disks not in by_disks or not is_mirrored(grid.reshape(target.rows, target.columns, 2)):
            by_disks[disks] = grid
    return list(by_disks.values())


def _measured(
    picture: Picture, target: AnyCircleGrid, rough: NDArray[np.float64], light: bool
) -> Detection | None:
    """Measure the disks (n, 2), which are in order; None where they are no picture of the target."""
    plane = target_points(target)[:, :2]
    view = view_of_plane(plane, rough)
    if view is None or is_mirrored(rough.reshape(target.rows, target.columns, 2)):
        return None
    misfits = np.linalg.norm(view.project(plane) - rough, axis=1)
    if np.any(misfits > LARGEST_MISFIT * target.spacing * view.scales(plane)):
        return None
    radius = target.disk_diameter / 2
    shapes = radius * view.jacobians(plane)
    wide = 1 + np.maximum(LEAST_RIM, ROOM_FOR_BLUR / (radius * view.scales(plane)))
    clear = np.minimum(wide, target.spacing / target.disk_diameter)
    centroids = disk_centroids(picture, Disks(rough, shapes, clear, light))
    if centroids is None:
        return None
    reading = upright(target, centroids.pixels)
    pixels, covariances = centroids.pixels[reading], centroids.covariances[reading]
    return Detection(np.arange(len(pixels)), pixels, covariances, disk="centroid")
