"""Corners of tags, measured as the crossings of their borders' outer edges.

Blur rounds a corner off, and an operator that looks at the corner alone is pulled inwards, by 0.2 to 0.5 px under
common blur; the sides stay where they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.detection.misfit import uncovered
from calib.detection.picture import Picture
from calib.detection.plane import BentView, bent_view, view_of_plane
from calib.detection.tag_fit import TagFit, first_look, fit_tags
from calib.detection.tag_sides import AFTER, BEFORE, Floats, Sides, sides_of
from calib.detection.tag_strips import strips_along
from calib.targets import AprilGrid, target_points

FIRST_BLUR = 1.0  # px; tried before it is known
MUCH_BLURRED = 1.25  # times what was thought: what was kept clear of other edges was not
MOST_TRIALS = 3
ROUGH, ROUGH_BOW = 1.5, 0.01  # px, and of a side: how far edges may be off the lines between rough corners
FEW_LINES, TRACKED_LINES, MANY_LINES = 12, 24, 64
MOST_MOVED, MAY_MOVE = 0.1, 3.0  # of a side, and px; more is another thing
LEAST_CONTRAST = 3.0  # times the noise
UNSETTLED = 200.0  # of the scatter: a step's gain in squares that is worth more than a few hundredths of a px
MISFIT = 0.1  # of the contrast; more and something else is in sight
COVERED = 0.012  # of the contrast; less is left where nothing covers a side
UNMODELLED_VARIANCE = 0.002**2  # px²; the shape of the pixels and of the lens' blur


@dataclass(frozen=True, eq=False)
class TagCorners:
    """Tags' corners: `pixels` (n, 4, 2) and their `covariances` (n, 4, 2, 2) in px²; `found` (n,) tells which are."""

    pixels: Floats
    covariances: Floats
    found: NDArray[np.bool_]


def measure_tags(picture: Picture, target: AprilGrid, tags: NDArray[np.int64], corners: Floats) -> TagCorners:
    """Measure the corners of tags (n,), clockwise, that are within 2 px or so of `corners` (n, 4, 2).

    Nothing but the pixels along the tags' sides is looked at: first a few, until corners and blur are roughly known.
    """
    sides, rough = _fitted(picture, target, tags, corners, FEW_LINES, None)
    near, _ = _crossings(sides, rough)
    points = target_points(target)[:, :2].reshape(-1, 4, 2)[tags].reshape(-1, 2)
    view = view_of_plane(points, near.reshape(-1, 2))
    bent = None if view is None else bent_view(view, points, near.reshape(-1, 2), picture.middle)
    sides = sides_of(target, tags, near)
    strips = strips_along(picture, sides, rough.blur, np.zeros_like(sides.lengths), MANY_LINES)
    return _judged(picture, corners, sides, fit_tags(strips, _courses(target, tags, sides, bent), rough.look))


def track_tags(
    picture: Picture, target: AprilGrid, tags: NDArray[np.int64], corners: Floats, view: BentView
) -> TagCorners:
    """Measure tags as `measure_tags` does, but by fewer pixels, as a view tells already how the lens bends sides."""
    return _judged(picture, corners, *_fitted(picture, target, tags, corners, TRACKED_LINES, view))


def _fitted(
    picture: Picture,
    target: AprilGrid,
    tags: NDArray[np.int64],
    corners: Floats,
    lines: int,
    view: BentView | None,
) -> tuple[Sides, TagFit]:
    """Fit tags whose corners and blur are roughly known to so many lines of pixels along each side."""
    unknown = ROUGH + ROUGH_BOW * np.linalg.norm(corners[:, AFTER] - corners, axis=-1)
    near, blur, look = corners, FIRST_BLUR, np.empty((0, 6))
    for _ in range(MOST_TRIALS):
        sides = sides_of(target, tags, near)
        strips = strips_along(picture, sides, blur, unknown, lines)
        courses = None if view is None else _courses(target, tags, sides, view)
        fit = fit_tags(strips, courses, look if len(look) else first_look(strips, blur))
        look, thought, blur = fit.look, blur, fit.blur
        if blur < MUCH_BLURRED * thought:
            break
        near, _ = _crossings(sides, fit)
    return sides, fit


def _judged(picture: Picture, corners: Floats, sides: Sides, fit: TagFit) -> TagCorners:
    """Give the corners of fitted tags, and tell which of these are tags near to `corners` (n, 4, 2)."""
    pixels, covariances = _crossings(sides, fit)
    shortest = sides.lengths.min(axis=1)
    found = np.abs(pixels - corners).max(axis=(1, 2)) < np.maximum(MOST_MOVED * shortest, MAY_MOVE)
    found &= (fit.unsettled < UNSETTLED) & (fit.contrast > LEAST_CONTRAST * picture.noise)
    found &= fit.scatter < (2 * picture.noise) ** 2 + (MISFIT * fit.contrast) ** 2
    # Where a corner is out of the picture there is a side without its end, or none.
    found = uncovered(np.sqrt(fit.scatter), fit.contrast, picture.noise, found, COVERED)
    found &= ((pixels > 0) & (pixels < np.array(picture.values.shape[::-1]) - 1)).all(axis=(1, 2))
    return TagCorners(pixels, covariances + UNMODELLED_VARIANCE * np.eye(2), found)


def _courses(target: AprilGrid, tags: NDArray[np.int64], sides: Sides, view: BentView | None) -> Floats:
    """Say how the lens bends sides: as it does the places of all corners. The courses (n, 4, 2) are `fit_tags`'s."""
    if view is None:
        return np.zeros((*sides.lengths.shape, 2))
    plane = target_points(target)[:, :2].reshape(-1, 4, 2)[tags]
    along = np.array([0, 0.25, 0.75, 1])[:, None]
    seen = view.project(plane[:, :, None] + along * (plane[:, AFTER] - plane)[:, :, None])
    first, last = seen[:, :, :1], seen[:, :, 3:]
    off = seen[:, :, 1:3] - first - along[1:3] * (last - first)
    early, late = np.moveaxis((off @ sides.normals[..., None])[..., 0], -1, 0)
    return np.stack([(early + late) / 1.5, (late - early) / 0.75], axis=-1)


def _crossings(sides: Sides, fit: TagFit) -> tuple[Floats, Floats]:
    """Find where each side crosses the one before: pixels (n, 4, 2) and their covariances (n, 4, 2, 2)."""
    meeting = np.array([[(2 * corner - 1) % 8, 2 * corner] for corner in range(4)])
    from_heights = np.linalg.inv(np.stack([sides.normals[:, BEFORE], sides.normals], axis=2))
    pixels = sides.corners + (from_heights @ fit.heights[:, meeting, None])[..., 0]
    covariances = fit.covariances[:, meeting[:, :, None], meeting[:, None, :]]
    return pixels, from_heights @ covariances @ from_heights.swapaxes(-1, -2)
