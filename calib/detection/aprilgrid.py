"""Grids of tags: each tag found by itself, its corners numbered by its id."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.detection import Detection
from calib.detection.picture import Picture
from calib.detection.plane import view_of_most
from calib.detection.tag_edges import refine_tag
from calib.errors import DetectionError
from calib.targets import AprilGrid, target_points

MISPLACED = 0.25  # of a tag's side in the picture: more than a lens bends a grid
CLEAR_OF_CELLS = 0.4  # of the border's width or the gap's, the narrower: the cells' own edges are blurred too
SHORTEST_REACH, LONGEST_REACH = 1.5, 8.0


def detect_aprilgrid(picture: Picture, target: AprilGrid) -> Detection:
    """Find the tags that can be seen; raises DetectionError where there is none.

    Tags whose id is not of the grid or is seen twice, and tags out of their place among the others, are left
    out.
    """
    tags, corners = _tags(picture, target)
    plane = target_points(target)[:, :2].reshape(-1, 4, 2)
    cells = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, target.dictionary)).markerSize + 2
    clear = CLEAR_OF_CELLS * min(target.spacing, target.tag / cells)

    ids, found = [], []
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    tolerance = MISPLACED * float(np.median(sides)) if len(tags) else 0.0
    seen = view_of_most(plane[tags].reshape(-1, 2), corners.reshape(-1, 2), tolerance)
    if seen is not None:
        view, agreeing = seen
        in_place = agreeing.reshape(-1, 4).all(axis=1)
        for tag, rough in zip(tags[in_place], corners[in_place], strict=True):
            scale = float(view.scales(plane[tag]).min())
            reach = min(max(clear * scale, SHORTEST_REACH), LONGEST_REACH)
            refined = refine_tag(picture, rough, reach)
            if refined is not None:
                ids.append(4 * tag + np.arange(4))
                found.append(refined)
    if not ids:
        raise DetectionError(
            f"no tag of the AprilGrid of {target.rows} x {target.columns} was found: {len(tags)} markers of "
            f"{target.dictionary} with ids below {target.rows * target.columns} were seen in the picture of "
            f"{picture.size}; is it in the picture, sharp and evenly lit?"
        )
    pixels = np.concatenate([tag_corners.pixels for tag_corners in found])
    covariances = np.concatenate([tag_corners.covariances for tag_corners in found])
    return Detection(np.concatenate(ids), pixels, covariances, disk=None)


def _tags(picture: Picture, target: AprilGrid) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Find the tags (n,) that are seen once, by growing id, and roughly their corners (n, 4, 2)."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, target.dictionary))
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    found, numbers, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(picture.grey)
    # OpenCV says None where there is nothing, whatever the annotation says.
    seen = np.array([] if numbers is None else numbers, dtype=np.int64).ravel()
    corners = np.array(found, dtype=np.float64).reshape(-1, 4, 2)
    tags, first, times = np.unique(seen, return_index=True, return_counts=True)
    wanted = (times == 1) & (tags < target.rows * target.columns)
    return tags[wanted], corners[first[wanted]]
