"""Centroids of disks' pictures, measured on the grey values."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.blurred_ellipse import LEAST_BLUR, Array, Ellipses, Samples, Values, fit
from calib.detection.picture import Picture

Places = NDArray[np.int64]

UNMODELLED_VARIANCE = 0.0005**2  # px²; what pixels are that are no points, and lenses within a disk
CORE = 0.6  # of the disk's radius: grey values in here are the disk's own
BLOCKS_A_RADIUS, LARGEST_BLOCK = 4, 8  # px; away from edges, means over blocks tell as much as pixels
FAR_OFF, NEAR = 2.5, 0.7  # an edge ends this many blurs and px to both of its sides
THINNED, ENOUGH = 4, 20  # to start with, one in so many blocks near the edges will do, but not fewer a disk
FEWEST_PIXELS = 15
LEAST_CONTRAST = 3.0  # times the noise
LEAST_COVERED, MOST_COVERED = 0.5, 1.5  # of the disk's area, or it is another thing


@dataclass(frozen=True, eq=False)
class Disks:
    """Roughly where n disks are: `centres` (n, 2) and `shapes` (n, 2, 2), the unit circle's maps to outlines, in px.

    There is nothing but paper round each disk, up to `clear` (n,) (more than 1) times its outline. They are
    `light` on dark paper, or dark on light.
    """

    centres: Array
    shapes: Array
    clear: Array
    light: bool


@dataclass(frozen=True, eq=False)
class Centroids:
    """Disks' centroids: `pixels` (n, 2), and their `covariances` (n, 2, 2) in px²."""

    pixels: Array
    covariances: Array


def disk_centroids(picture: Picture, disks: Disks) -> Centroids | None:
    """Measure the centroids of disks' pictures; None where one of them is no such disk."""
    radii = np.linalg.svd(disks.shapes, compute_uv=False)
    blocks = _blocks(picture, disks, int(np.clip(radii.min() / BLOCKS_A_RADIUS, 1, LARGEST_BLOCK)))
    start = _start(picture, disks, blocks)
    if start is None:
        return None
    ellipses = start
    # What is no disk may lead anywhere, and is found out afterwards.
    with np.errstate(over="ignore", invalid="ignore"):
        for most_thinned in (THINNED, 1):
            edges, plain = _shared_out(picture, ellipses, blocks, most_thinned)
            if np.any(np.count_nonzero(edges.weights, axis=1) < FEWEST_PIXELS):
                return None
            ellipses, covariances, _ = fit(ellipses, edges, plain)
        if not _are_disks(picture, disks, ellipses):
            return None
    return Centroids(disks.centres + ellipses.centres, covariances + UNMODELLED_VARIANCE * np.eye(2))


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Means over blocks of size x size pixels in a window round each disk, row by row.

    `radii` (n, m) are such that the rough outline is at 1. Blocks that are not clear of other things weigh 0.
    """

    size: int
    first: Places  # (n, 2) column and row of the window's first block
    columns: int
    samples: Samples
    radii: Values

    def pixels(self, picture: Picture, places: Places) -> Samples:
        """Give the pixels (k, size²) of k blocks, named by their places in all windows' rows."""
        row, column = (each.ravel() for each in np.indices((self.size, self.size)))
        disk, place = np.divmod(places, self.radii.shape[1])
        first_row, first_column = np.divmod(place, self.columns)
        first_column = self.size * (self.first[disk, 0] + first_column)
        first_row = self.size * (self.first[disk, 1] + first_row)
        width = picture.values.shape[1]
        values = np.take(picture.values, (first_row * width + first_column)[:, None] + (row * width + column))
        middle = (self.size - 1) / 2
        x = self.samples.x.ravel()[places][:, None] + (column - middle).astype(np.float32)
        y = self.samples.y.ravel()[places][:, None] + (row - middle).astype(np.float32)
        return Samples(x, y, values.astype(np.float32), np.ones_like(x))


def _blocks(picture: Picture, disks: Disks, size: int) -> _Blocks:
    """Cut windows out of the picture that hold all that is clear round each disk."""
    height, width = (side // size for side in picture.values.shape)
    whole = picture.values[: height * size, : width * size].astype(np.float32)
    averaged = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)
    reach = disks.clear[:, None] * np.linalg.norm(disks.shapes, axis=2)
    first = np.floor((disks.centres - reach) / size).astype(np.int64)
    columns, rows = np.ceil(2 * reach.max(axis=0) / size).astype(int) + 1
    column = first[:, :1] + np.arange(columns)
    row = first[:, 1:] + np.arange(rows)
    places = np.clip(row, 0, height - 1)[:, :, None] * width + np.clip(column, 0, width - 1)[:, None]
    values = np.take(averaged, places)
    x = (size * (column + 0.5) - 0.5 - disks.centres[:, :1]).astype(np.float32)[:, None]
    y = (size * (row + 0.5) - 0.5 - disks.centres[:, 1:]).astype(np.float32)[:, :, None]
    to_circle = np.linalg.inv(disks.shapes).astype(np.float32)[..., None, None]
    across, down = (to_circle[:, i, 0] * x + to_circle[:, i, 1] * y for i in (0, 1))
    radii = np.sqrt(across * across + down * down)
    within = ((column >= 0) & (column < width))[:, None] & ((row >= 0) & (row < height))[:, :, None]
    clear = within & (radii < disks.clear.astype(np.float32)[:, None, None])
    weights = clear * np.float32(size * size)
    listed = (np.broadcast_to(each, radii.shape).reshape(len(radii), -1) for each in (x, y, values, weights))
    return _Blocks(size, first, columns, Samples(*listed), radii.reshape(len(radii), -1))


def _start(picture: Picture, disks: Disks, blocks: _Blocks) -> Ellipses | None:
    """Take each disk for what is nearer to the ink than to the paper; None where there is no such difference."""
    x, y, values, weights = blocks.samples
    core = (blocks.radii < CORE) & (weights > 0)
    rim = (blocks.radii > (1 + disks.clear[:, None]) / 2) & (weights > 0)
    if not np.all(core.any(axis=1) & rim.any(axis=1)):
        return None
    ink, paper = (np.sum(values * part, axis=1) / part.sum(axis=1) for part in (core, rim))
    contrast = ink - paper if disks.light else paper - ink
    if np.any(contrast < LEAST_CONTRAST * picture.noise):
        return None
    covered = np.clip((values - paper[:, None]) / (ink - paper)[:, None], 0, 1) * (weights > 0)
    # Neither noise nor a light that changes from side to side makes up half of the contrast.
    clearly = np.clip(2 * covered - 0.5, 0, 1)
    area = clearly.sum(axis=1)
    if np.any(area == 0):
        return None
    centres = np.stack([np.sum(clearly * x, axis=1), np.sum(clearly * y, axis=1)], axis=1) / area[:, None]
    vx, vy = x - centres[:, :1], y - centres[:, 1:]
    # An ellipse's second moments are a quarter of its outline's.
    xx, xy, yy = (4 * np.sum(clearly * product, axis=1) / area for product in (vx * vx, vx * vy, vy * vy))
    determinant = xx * yy - xy**2
    if np.any(determinant <= 0):
        return None
    shapes = np.stack([yy, -xy, xx], axis=1) / determinant[:, None]
    # Across an edge, covered (1 - covered) adds up to its blur over the square root of pi.
    mixed = np.sum(covered * (1 - covered), axis=1) * blocks.size**2
    circumference = np.pi * np.sqrt(2 * (xx + yy))
    spread = np.square(np.sqrt(np.pi) * mixed / circumference)
    blurs = np.sqrt(np.maximum(spread - (blocks.size**2 - 1) / 12, (2 * LEAST_BLUR) ** 2))
    return Ellipses(centres, shapes, blurs, paper, ink, np.zeros_like(centres))


def _shared_out(
    picture: Picture, ellipses: Ellipses, blocks: _Blocks, most_thinned: int
) -> tuple[Samples, Samples]:
    """Take single pixels near the edges, and elsewhere the blocks, which tell no less of paper and ink.

    Near the edges, the pixels of one block in up to `most_thinned` are taken.
    """
    count, samples = len(ellipses.blurs), blocks.samples
    reach = FAR_OFF * ellipses.blurs[:, None] + NEAR
    mixed = np.abs(ellipses.distances(samples.x, samples.y)) < reach + (blocks.size - 1) / np.sqrt(2)
    clear = samples.weights > 0
    plain = _packed(*_listed(samples, np.flatnonzero(~mixed & clear)), count)

    places = np.flatnonzero(mixed & clear)
    every = int(np.clip(len(places) // (ENOUGH * count), 1, most_thinned))
    places = places[::every]
    if blocks.size == 1:
        return _packed(*_listed(samples, places), count), plain
    pixels = blocks.pixels(picture, places)
    disk = places // mixed.shape[1]
    near = np.abs(ellipses.part(disk).distances(pixels.x, pixels.y)) < reach[disk]
    block, listed = _listed(pixels, np.flatnonzero(near))
    return _packed(disk[block], listed, count), plain


def _listed(samples: Samples, places: Places) -> tuple[Places, Samples]:
    """List the samples (n, m) at some places of all rows together, and the rows that they are of."""
    return places // samples.x.shape[1], Samples(*(each.ravel()[places] for each in samples))


def _packed(disk: Places, samples: Samples, count: int) -> Samples:
    """Put a list of samples, by growing disk, into one row for each of `count` disks."""
    lengths = np.bincount(disk, minlength=count)
    place = np.arange(len(disk)) - (np.cumsum(lengths) - lengths)[disk]
    longest = max(lengths.max(initial=0), 1)
    rows = np.zeros((len(samples), count, longest), np.float32)
    for row, each in zip(rows, samples, strict=True):
        row.ravel()[disk * longest + place] = each
    return Samples(*rows)


def _are_disks(picture: Picture, disks: Disks, ellipses: Ellipses) -> bool:
    """Tell whether all ellipses are where disks are to be, of about their size, and of the right colours."""
    xx, xy, yy = ellipses.shapes.T
    determinant = xx * yy - xy**2
    if not np.all(determinant > 0):
        return False
    covered = 1 / (np.sqrt(determinant) * np.abs(np.linalg.det(disks.shapes)))
    contrast = ellipses.ink - ellipses.paper if disks.light else ellipses.paper - ellipses.ink
    furthest = 0.5 * np.abs(disks.shapes).sum(axis=2).max(axis=1) + 1
    return bool(
        np.all((covered > LEAST_COVERED) & (covered < MOST_COVERED))
        and np.all(contrast > LEAST_CONTRAST * picture.noise)
        and np.all(np.abs(ellipses.centres).max(axis=1) < furthest)
    )
