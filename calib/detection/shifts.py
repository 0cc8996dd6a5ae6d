"""How far the marks of a target are from where they are expected."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.marks import Marks
from calib.detection.places import Places
from calib.detection.plane import FEWEST
from calib.detection.window import CLEAR_OF_NOISE, Window

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FURTHEST = 0.45  # of the distance between marks: what is further off is nearer to another one's place
PLACES_ACROSS = 9  # an edge
SCATTERED = 0.7549, 0.5698  # steps whose multiples, less whole numbers, are evenly spread
TOGETHER = 0.3  # of what is clear across edges, that marks may move apart and be of one target


def shifts_of(window: Window, marks: Marks, places: Places, off: float) -> tuple[Array, Mask]:
    """Find how far (m, 2) the edges of marks are from where they are expected, and which marks (m,) have contrast."""
    lengths = np.hypot(places.across[..., 0], places.across[..., 1])
    shifts = _searched(window, marks, places, off, float(lengths.min()))
    edges = places.edges if shifts is None else places.edges + shifts[:, None]
    # Each edge is looked at elsewhere between the places of the others, so that their errors cancel.
    by_mark, by_edge = (step * np.arange(count) for step, count in zip(SCATTERED, lengths.shape, strict=True))
    between = (by_mark[:, None] + by_edge) % 1 - 0.5
    along = (2 * (np.arange(PLACES_ACROSS) + between[..., None]) + 1) / PLACES_ACROSS - 1
    values = window.at(edges[:, :, None] + along[..., None] * places.across[:, :, None])
    darkest, brightest = values.min(axis=(1, 2)), values.max(axis=(1, 2))
    inside = (values < ((darkest + brightest) / 2)[:, None, None]).mean(axis=2)
    if marks.either_way and np.sum(values[..., 0] - values[..., -1]) > 0:
        inside = 1 - inside
    normals = places.across / lengths[..., None]
    off_edges = lengths * (2 * inside - 1 + 2 / PLACES_ACROSS * between)
    matrices = normals.swapaxes(1, 2) @ normals
    found = np.linalg.solve(matrices, normals.swapaxes(1, 2) @ off_edges[..., None])[..., 0]
    contrasted = brightest - darkest > CLEAR_OF_NOISE * window.noise
    return found if shifts is None else shifts + found, contrasted


def _searched(window: Window, marks: Marks, places: Places, off: float, clear: float) -> Array | None:
    """Try shifts of up to `off` px of each mark by itself: where ink and paper differ most (m, 2).

    They are half of what is `clear` (px) across edges apart: an edge that is further off than that is seen together
    with what is beyond. None where that is further than `off`.
    """
    furthest = min(off, FURTHEST * marks.spacing / marks.clear * clear)
    step = clear / 2
    if furthest <= step:
        return None
    count = int(furthest / step)
    along = step * np.arange(-count, count + 1)
    shifts = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    shifts = shifts[np.hypot(shifts[:, 0], shifts[:, 1]) <= furthest]
    own = len(marks.points)
    values = window.at(places.samples[:own] + shifts[:, None, None])
    contrasts = np.einsum("tmk,mk->tm", values, marks.paper[:own] - marks.ink[:own])
    if marks.either_way and contrasts.max(axis=0).sum() < -contrasts.min(axis=0).sum():
        contrasts = -contrasts
    return np.asarray(shifts[contrasts.argmax(axis=0)])


def moved_together(places: Places, shifts: Array, usable: Mask) -> Places:
    """Move all places by the homography that most of the marks agree in."""
    points = places.points[usable].reshape(-1, 2)
    if len(points) < FEWEST:
        return places
    moved = (places.points + shifts[:, None])[usable].reshape(-1, 2)
    tolerance = max(TOGETHER * float(np.abs(places.across).max()), 1.0)
    homography, _ = cv2.findHomography(points, moved, cv2.RANSAC, tolerance)
    # OpenCV says None where there is none, whatever the annotation says.
    return places if homography is None else places.mapped(np.asarray(homography))
