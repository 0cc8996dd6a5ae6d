"""Disks' centroids from a few of their pixels, evenly spread along their edges: where they are is known already."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.detection.blurred_ellipse import Array, Ellipses, Samples, fit
from calib.detection.disks import UNMODELLED_VARIANCE

APART = 1.42  # px; two places further apart than a pixel's diagonal are never in the same one
ACROSS = APART * np.arange(-2, 3)  # px from the edge
FEWEST_RAYS, MOST_RAYS = 12, 24
INNERMOST = 0.3  # of the radius: further in, rays are too dense
PLAIN = 5.0  # px from the edge; there the blur has ended
LIGHT_RAYS = 6
LIGHT_AT = np.array([0.0, 0.4, 0.7, 1.25, 1.5])  # radii
FIRST_BLUR = 0.9  # px
STANDS_STILL = 0.1  # px; the next step would be less than such points scatter
LEAST_COVERED, MOST_COVERED = 0.7, 1.4  # of the expected area


@dataclass(frozen=True, eq=False)
class SparseDisks:
    """Where n disks are to about a pixel: `centres` (n, 2), and `shapes` (n, 2, 2), the unit circle's maps to outlines.

    There is nothing but paper round each up to `clear` times its outline. `paper` and `ink` (n,) are grey values.
    """

    centres: Array
    shapes: Array
    clear: float
    paper: Array
    ink: Array


@dataclass(frozen=True, eq=False)
class SparseCentroids:
    """Disks' `pixels` (n, 2), and their `covariances` (n, 2, 2) in px².

    `left` (n,) is the standard deviation of the grey values from the fit; `good` (n,) tells which have about the
    expected size.
    """

    pixels: Array
    covariances: Array
    left: Array
    good: NDArray[np.bool_]


def sparse_centroids(values: NDArray[np.uint8 | np.uint16], disks: SparseDisks) -> SparseCentroids:
    """Measure disks in grey values (h, w) which hold all of them, and all that is clear round them."""
    radii = np.sqrt(np.abs(np.linalg.det(disks.shapes)))
    count = int(np.clip(2 * np.pi * np.median(radii) / APART, FEWEST_RAYS, MOST_RAYS))
    rays = disks.shapes @ _circle(count)
    lengths = np.sqrt(np.square(rays).sum(axis=1))[:, None]
    across = ACROSS[:, None] / lengths
    reached = 1 + across
    edges = _samples(values, disks, rays, reached, (reached > INNERMOST) & (reached < disks.clear))

    few = disks.shapes @ _circle(LIGHT_RAYS)
    at = np.broadcast_to(LIGHT_AT[:, None], (len(few), len(LIGHT_AT), LIGHT_RAYS))
    apart = np.abs(at - 1) * np.sqrt(np.square(few).sum(axis=1))[:, None]
    plain = _samples(values, disks, few, at, (apart > PLAIN) & (at < disks.clear))

    with np.errstate(all="ignore"):  # what is no disk may lead anywhere, and is found out afterwards
        inverses = np.linalg.inv(disks.shapes @ disks.shapes.swapaxes(1, 2))
        start = Ellipses(
            centres=np.zeros_like(disks.centres),
            shapes=np.stack([inverses[:, 0, 0], inverses[:, 0, 1], inverses[:, 1, 1]], axis=1),
            blurs=np.full(len(radii), FIRST_BLUR),
            paper=disks.paper,
            ink=disks.ink,
            slopes=np.zeros_like(disks.centres),
        )
        ellipses, covariances, variances = fit(start, edges, plain, STANDS_STILL)
        xx, xy, yy = ellipses.shapes.T
        covered = 1 / (np.sqrt(xx * yy - xy**2) * radii**2)
        good = (covered > LEAST_COVERED) & (covered < MOST_COVERED)
        good &= (ellipses.ink - ellipses.paper) * (disks.ink - disks.paper) > 0
    return SparseCentroids(
        disks.centres + ellipses.centres,
        covariances + UNMODELLED_VARIANCE * np.eye(2),
        np.sqrt(variances),
        good,
    )


def _circle(count: int) -> Array:
    angles = 2 * np.pi * np.arange(count) / count
    return np.stack([np.cos(angles), np.sin(angles)])


def _samples(
    values: NDArray[np.uint8 | np.uint16],
    disks: SparseDisks,
    rays: Array,
    reached: Array,
    wanted: NDArray[np.bool_],
) -> Samples:
    """Take the pixels nearest to places along rays (n, 2, r), by how far (n, a, r) they reach."""
    count, width = len(rays), values.shape[1]
    x, y = (
        np.rint(disks.centres[:, axis, None, None] + reached * rays[:, axis, None]).astype(np.int32)
        for axis in (0, 1)
    )
    taken = np.take(values, y * width + x, mode="clip").astype(np.float32).reshape(count, -1)
    off_x, off_y = (
        (at - disks.centres[:, axis, None, None]).astype(np.float32).reshape(count, -1)
        for axis, at in enumerate((x, y))
    )
    return Samples(off_x, off_y, taken, wanted.astype(np.float32).reshape(count, -1))
