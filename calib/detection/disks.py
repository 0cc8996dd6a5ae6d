"""Centroids of disks' pictures, measured on the grey values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.detection.picture import Picture

MOST_REPEATS = 4
STANDS_STILL = 0.01  # px
UNMODELLED_VARIANCE = 0.01**2  # px²; the print, and the plane that stands for the light
CORE = 0.6  # of the disk's radius: grey values in here are the disk's own
FEWEST_FOR_A_PLANE = 8
LEAST_CONTRAST = 3.0  # times the noise
LEAST_COVERED, MOST_COVERED = 0.5, 1.5  # of the disk's area, or it is another thing


@dataclass(frozen=True, eq=False)
class Disk:
    """Roughly where a disk is: `centre` (2,) and `shape` (2, 2), the unit circle's map to its outline, in px.

    There is nothing but paper round the disk, up to `clear` (more than 1) times its outline. It is `light` on
    dark paper, or dark on light.
    """

    centre: NDArray[np.float64]
    shape: NDArray[np.float64]
    clear: float
    light: bool


@dataclass(frozen=True, eq=False)
class Centroid:
    """A disk's centroid: `pixel` (2,), and its `covariance` (2, 2) in px²."""

    pixel: NDArray[np.float64]
    covariance: NDArray[np.float64]


def disk_centroid(picture: Picture, disk: Disk) -> Centroid | None:
    """Measure the centroid of a disk's picture; None where there is no such disk.

    Each pixel counts by how much of it the disk covers. The window is centred anew on each result, so that it
    does not cut off more on one side than on the other.
    """
    furthest = 0.5 * np.abs(disk.shape).sum(axis=1).max() + 1
    centre = disk.centre
    for _ in range(MOST_REPEATS):
        centroid = _centroid(picture, disk, centre)
        if centroid is None or np.abs(centroid.pixel - disk.centre).max() > furthest:
            return None
        if np.abs(centroid.pixel - centre).max() < STANDS_STILL:
            break
        centre = centroid.pixel
    return centroid


def _centroid(picture: Picture, disk: Disk, centre: NDArray[np.float64]) -> Centroid | None:
    """Measure the centroid in a window round `centre`.

    Disk and paper are told apart by their grey values, under a light that may change from side to side. Light
    multiplies what both reflect: the brighter of the two shows it best, as a plane of grey values, and the
    contrast between them is in proportion to it.
    """
    window = _window(picture, disk, centre)
    core = window.radii < CORE
    rim = window.radii > (1 + disk.clear) / 2
    if not core.any() or not rim.any():
        return None
    plane = _plane(window, rim)
    paper = plane.values
    signal = window.values - paper if disk.light else paper - window.values
    light = _plane(window, core).values if disk.light else paper
    step = np.median(signal[core])
    if step < LEAST_CONTRAST * picture.noise or light.min() <= 0:
        return None
    contrast = light * (step / np.median(light[core]))
    weights = window.membership * signal / contrast
    total = weights.sum()
    area = window.membership[window.radii < 1].sum()
    if not LEAST_COVERED * area < total < MOST_COVERED * area:
        return None
    offset = weights @ window.offsets / total

    # What one grey level more in each pixel would move, directly and by way of the paper's plane.
    levers = (window.membership / contrast)[:, None] * (window.offsets - offset) / total
    levers[rim] -= plane.levers_on_part(levers)
    covariance = picture.noise**2 * (levers.T @ levers) + UNMODELLED_VARIANCE * np.eye(2)
    return Centroid(centre + offset, covariance)


@dataclass(frozen=True, eq=False)
class _Window:
    """The m pixels round a disk."""

    offsets: NDArray[np.float64]  # (m, 2) from the centre, px
    radii: NDArray[np.float64]  # (m,) in which the disk's outline is at 1
    membership: NDArray[np.float64]  # (m,) how much of the pixel is in the window
    values: NDArray[np.float64]  # (m,) grey values


def _window(picture: Picture, disk: Disk, centre: NDArray[np.float64]) -> _Window:
    last = np.array(picture.values.shape[::-1]) - 1
    reach = disk.clear * np.linalg.norm(disk.shape, axis=1) + 1
    left, top = np.clip(np.floor(centre - reach), 0, last).astype(int)
    right, bottom = np.clip(np.ceil(centre + reach), 0, last).astype(int)
    y, x = np.mgrid[top : bottom + 1, left : right + 1].reshape(2, -1)
    offsets = np.column_stack([x, y]) - centre
    radii = np.sqrt(np.square(offsets @ np.linalg.inv(disk.shape).T).sum(axis=1))
    pixels_a_radius = np.sqrt(abs(np.linalg.det(disk.shape)))
    membership = np.clip((disk.clear - radii) * pixels_a_radius + 0.5, 0, 1)
    inside = membership > 0
    values = picture.values[top : bottom + 1, left : right + 1].ravel()
    return _Window(offsets[inside], radii[inside], membership[inside], values[inside].astype(np.float64))


@dataclass(frozen=True, eq=False)
class _Plane:
    """A plane of grey values over the window's m pixels, fitted to p of them."""

    terms: NDArray[np.float64]  # (m, k): offsets and one, or one alone for a level plane
    coefficients_from_part: NDArray[np.float64]  # (k, p)
    values: NDArray[np.float64]  # (m,)

    def levers_on_part(self, levers: NDArray[np.float64]) -> NDArray[np.float64]:
        """Turn what the plane's values move (m, 2) into what the part's grey values move (p, 2)."""
        return self.coefficients_from_part.T @ (self.terms.T @ levers)


def _plane(window: _Window, part: NDArray[np.bool_]) -> _Plane:
    """Fit a plane to the grey values of a part of the window; a level one where it has too few pixels."""
    terms = np.ones((len(part), 3))
    terms[:, :2] = window.offsets
    if part.sum() < FEWEST_FOR_A_PLANE:
        terms = terms[:, 2:]
    fitted = terms[part]
    coefficients_from_part = np.asarray(np.linalg.solve(fitted.T @ fitted, fitted.T), dtype=np.float64)
    return _Plane(terms, coefficients_from_part, terms @ (coefficients_from_part @ window.values[part]))
