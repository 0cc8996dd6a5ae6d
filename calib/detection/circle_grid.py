"""Grids of disks, symmetric and asymmetric: found as blobs, put in order, and measured."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.detection import Detection
from calib.detection.disks import Disks, disk_centroids
from calib.detection.labelling import is_mirrored, upright
from calib.detection.picture import Picture, copies, in_original
from calib.detection.plane import view_of_plane
from calib.errors import DetectionError
from calib.targets import AsymmetricCircleGrid, CircleGrid, target_points

SEARCHED_SIDE = 480
LARGEST_MISFIT = (
    0.25  # of the distance between disks: more than a lens bends a grid, less than a wrong order does
)
LEAST_RIM, ROOM_FOR_BLUR = 0.5, 8.0  # radii, px: more paper than this round a disk adds nothing but noise
MOST_BLOBS = 4  # times as many as there are disks: in a busier picture the search for a grid never ends

AnyCircleGrid = CircleGrid | AsymmetricCircleGrid


def detect_circle_grid(picture: Picture, target: AnyCircleGrid) -> Detection:
    """Find all disks, dark on light or light on dark; raises DetectionError where any is missing."""
    most_blobs = 0
    for light, blobs, scale in _blobs(picture.grey):
        most_blobs = max(most_blobs, len(blobs))
        for centres in _grids(blobs, target):
            detection = _measured(picture, target, in_original(centres, scale), light)
            if detection is not None:
                return detection
    raise DetectionError(
        f"the {target.rows} x {target.columns} {target.kind.replace('_', ' ')} was not found: of its "
        f"{target.rows * target.columns} disks at most {most_blobs} blobs were seen in the picture of "
        f"{picture.size}; is the whole target in it, sharp, evenly lit and with disks of the given size?"
    )


def _blobs(grey: NDArray[np.uint8]) -> Iterator[tuple[bool, NDArray[np.float32], float]]:
    """Look for blobs: whether light, centres (n, 2) in a copy of the picture, the copy's scale."""
    for searched, scale in copies(grey, SEARCHED_SIDE):
        calm = cv2.GaussianBlur(searched, (3, 3), 0)  # noise frays outlines
        for light in (False, True):
            blobs = _blob_detector(searched.size, light).detect(calm)
            yield light, np.array([blob.pt for blob in blobs], dtype=np.float32).reshape(-1, 2), scale


def _blob_detector(pixels: int, light: bool) -> cv2.SimpleBlobDetector:
    parameters = cv2.SimpleBlobDetector.Params()
    parameters.blobColor = 255 if light else 0
    parameters.minThreshold, parameters.maxThreshold, parameters.thresholdStep = 20, 240, 25
    parameters.minArea, parameters.maxArea = 12, pixels / 12
    parameters.minDistBetweenBlobs = 3
    parameters.filterByConvexity, parameters.minConvexity = True, 0.85
    parameters.filterByInertia, parameters.minInertiaRatio = True, 0.1
    return cv2.SimpleBlobDetector.create(parameters)


def _grids(blobs: NDArray[np.float32], target: AnyCircleGrid) -> Iterator[NDArray[np.float64]]:
    """Look for grids among the blobs: centres (rows, columns, 2), in any order that OpenCV may choose."""
    count = target.rows * target.columns
    if not count <= len(blobs) <= MOST_BLOBS * count:
        return
    shape = cv2.CALIB_CB_SYMMETRIC_GRID if isinstance(target, CircleGrid) else cv2.CALIB_CB_ASYMMETRIC_GRID
    for search in (cv2.CALIB_CB_CLUSTERING, 0):
        # Without a detector the points stand in for the picture, which the annotations do not know.
        found, centres = cv2.findCirclesGrid(  # type: ignore[call-overload]
            blobs[:, None],
            (target.columns, target.rows),
            shape | search,
            None,
            cv2.CirclesGridFinderParameters(),
        )
        if found:
            yield np.asarray(centres, dtype=np.float64).reshape(target.rows, target.columns, 2)


def _measured(
    picture: Picture, target: AnyCircleGrid, centres: NDArray[np.float64], light: bool
) -> Detection | None:
    """Put the centres in order and measure their disks; None where they are no picture of the target."""
    plane = target_points(target)[:, :2]
    for grid in _orders(centres, target):
        rough = grid.reshape(-1, 2)
        view = view_of_plane(plane, rough)
        if view is None:
            continue
        misfits = np.linalg.norm(view.project(plane) - rough, axis=1)
        if np.any(misfits > LARGEST_MISFIT * target.spacing * view.scales(plane)):
            continue
        radius = target.disk_diameter / 2
        shapes = radius * view.jacobians(plane)
        wide = 1 + np.maximum(LEAST_RIM, ROOM_FOR_BLUR / (radius * view.scales(plane)))
        clear = np.minimum(wide, target.spacing / target.disk_diameter)
        centroids = disk_centroids(picture, Disks(rough, shapes, clear, light))
        if centroids is not None:
            reading = upright(target, centroids.pixels)
            pixels, covariances = centroids.pixels[reading], centroids.covariances[reading]
            return Detection(np.arange(len(pixels)), pixels, covariances, disk="centroid")
    return None


def _orders(centres: NDArray[np.float64], target: AnyCircleGrid) -> Iterator[NDArray[np.float64]]:
    """List the readings of a grid (rows, columns, 2) that are no mirror images."""
    if isinstance(target, CircleGrid):
        yield centres[:, ::-1] if is_mirrored(centres) else centres
        return
    orders = [centres]
    if target.rows % 2 == 0:
        # OpenCV may take the second row for the first, and then swaps all pairs of rows.
        pairs = centres.reshape(target.rows // 2, 2, target.columns, 2)
        orders.append(pairs[:, ::-1].reshape(centres.shape))
    for order in orders:
        if not is_mirrored(order):
            yield order
        elif target.rows % 2:
            yield order[::-1]
