"""Grids of tags: each tag found by itself, its corners numbered by its id."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.detection import Detection
from calib.detection.edge_profile import FIRST_BLUR
from calib.detection.picture import Picture
from calib.detection.plane import PlaneView, bent_view, view_of_most
from calib.detection.tag_outlines import Outlines, inward_normals, refine_tags
from calib.errors import DetectionError
from calib.targets import AprilGrid, target_points

MISPLACED = 0.25  # of a tag's side in the picture: more than a lens bends a grid


def detect_aprilgrid(picture: Picture, target: AprilGrid) -> Detection:
    """Find the tags that can be seen; raises DetectionError where there is none.

    Tags whose id is not of the grid or is seen twice, and tags out of their place among the others, are left
    out.
    """
    tags, corners = _tags(picture, target)
    plane = target_points(target)[:, :2].reshape(-1, 4, 2)

    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    tolerance = MISPLACED * float(np.median(sides)) if len(tags) else 0.0
    seen = view_of_most(plane[tags].reshape(-1, 2), corners.reshape(-1, 2), tolerance)
    in_place = np.zeros(len(tags), dtype=bool)
    if seen is not None:
        view, agreeing = seen
        in_place = np.asarray(agreeing.reshape(-1, 4).all(axis=1))
    tags, corners = tags[in_place], corners[in_place]
    blur = FIRST_BLUR
    # At first the corners are pulled inwards, and what they say of the lens' bend is no more than a start.
    for _ in range(2):
        if seen is not None and len(tags):
            refined = refine_tags(picture, _outlines(view, target, tags, corners), blur)
            tags, corners = tags[refined.found], refined.pixels[refined.found]
            covariances, blur = refined.covariances[refined.found], refined.blur
    if not len(tags):
        raise DetectionError(
            f"no tag of the AprilGrid of {target.rows} x {target.columns} was found: {len(in_place)} markers of "
            f"{target.dictionary} with ids below {target.rows * target.columns} were seen in the picture of "
            f"{picture.size}; is it in the picture, sharp and evenly lit?"
        )
    ids = 4 * tags[:, None] + np.arange(4)
    return Detection(ids.ravel(), corners.reshape(-1, 2), covariances.reshape(-1, 2, 2), disk=None)


def _outlines(
    view: PlaneView, target: AprilGrid, tags: NDArray[np.int64], corners: NDArray[np.float64]
) -> Outlines:
    """Say what tags (n,) look like whose corners (n, 4, 2) are roughly at these pixels."""
    dictionary = _dictionary(target)
    cells = np.array([_outer_cells(dictionary, int(tag)) for tag in tags], dtype=np.float64).reshape(
        len(tags), 4, -1
    )
    cell = target.tag / cells.shape[2]

    plane = target_points(target)[:, :2].reshape(-1, 4, 2)[tags]
    bent = bent_view(view, plane.reshape(-1, 2), corners.reshape(-1, 2))
    following = np.roll(plane, -1, axis=1)
    starts, ends, middles = (bent.project(at) for at in (plane, following, (plane + following) / 2))
    normals = inward_normals(starts)
    bows = ((middles - (starts + ends) / 2) * normals).sum(axis=-1)
    clear = min(target.spacing, 2 * cell) * view.scales(plane.reshape(-1, 2)).reshape(-1, 4).min(axis=1)
    return Outlines(corners, bows, cells, clear)


def _outer_cells(dictionary: cv2.aruco.Dictionary, tag: int) -> list[NDArray[np.uint8]]:
    """List the colours of the outermost cells along a tag's four sides, clockwise, between black ends."""
    bits = cv2.aruco.Dictionary.getBitsFromByteList(
        dictionary.bytesList[tag : tag + 1], dictionary.markerSize
    )
    return [np.pad(np.rot90(bits, turns)[0], 1) for turns in range(4)]


def _dictionary(target: AprilGrid) -> cv2.aruco.Dictionary:
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, target.dictionary))


def _tags(picture: Picture, target: AprilGrid) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Find the tags (n,) that are seen once, by growing id, and roughly their corners (n, 4, 2)."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    found, numbers, _ = cv2.aruco.ArucoDetector(_dictionary(target), parameters).detectMarkers(picture.grey)
    # OpenCV says None where there is nothing, whatever the annotation says.
    seen = np.array([] if numbers is None else numbers, dtype=np.int64).ravel()
    corners = np.array(found, dtype=np.float64).reshape(-1, 4, 2)
    tags, first, times = np.unique(seen, return_index=True, return_counts=True)
    wanted = (times == 1) & (tags < target.rows * target.columns)
    return tags[wanted], corners[first[wanted]]
