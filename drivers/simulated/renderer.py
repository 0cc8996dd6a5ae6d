"""What the light draws on the sensor: each pixel's ray cast to the plate, averaged over its square.

A pixel without an edge needs one ray. One that a straight edge crosses has its exact share of either side,
and one with a corner is sampled. So edges lie where the geometry puts them, to a thousandth of a pixel.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.simulated.caster import Caster
from drivers.simulated.coverage import CORNERS, share, spread
from drivers.simulated.lens import Lens, RayField, ray_field
from drivers.simulated.plate import Plate

Array = NDArray[np.float64]
Grey = NDArray[np.float32]
Indices = NDArray[np.intp]

_SAMPLES = 64
"""Rays in a pixel that has a corner of the pattern in it."""
_BATCH = 2048
"""Such pixels sampled at a time, so that their rays stay in the processor's cache."""
_BAND = 32
"""Rows cast at a time, for the same reason."""
_BACKGROUND_STEP = 16
"""Pixels between the places where the smooth background is computed."""


@dataclass(frozen=True)
class Renderer:
    """Pictures of one plate through one lens, (height, width) in grey levels."""

    plate: Plate
    lens: Lens
    width: int
    height: int

    def prepare(self) -> None:
        """Invert the lens, which takes as long as many pictures. Raises OptionsError where that fails."""
        ray_field(self.lens, self.width, self.height)

    def render(self, world_from_camera: Array) -> Grey:
        """Return what a camera of this pose (4, 4) sees in an instant, free of blur and noise."""
        rays = ray_field(self.lens, self.width, self.height)
        picture = self._background(rays, world_from_camera)
        left, top, right, bottom = self._window(world_from_camera)
        if left >= right or top >= bottom:
            return picture
        caster = Caster(self.plate, world_from_camera)
        ink, paper = np.empty((2, bottom - top, right - left), np.float32)
        for first in range(top, bottom, _BAND):
            band = slice(first, min(first + _BAND, bottom))
            seen = (slice(band.start + 1, band.stop + 1), slice(left + 1, right + 1))
            drawn = slice(band.start - top, band.stop - top)
            ink[drawn], paper[drawn] = (depth > 0 for depth in caster.depths(rays.x[seen], rays.y[seen]))
        rows, columns = np.nonzero(_on_edges(ink + paper))
        pixels = (rows + top + 1, columns + left + 1)
        ink[rows, columns], paper[rows, columns] = _shares(caster, rays, pixels)

        tones = self.plate.options
        view = picture[top:bottom, left:right]
        view += paper * (np.float32(tones.paper) - view)
        view += ink * np.float32(tones.ink - tones.paper)
        return picture

    def _window(self, world_from_camera: Array) -> tuple[int, int, int, int]:
        """Return the columns and rows (left, top, right, bottom) that may see the plate."""
        outline = self.plate.outline() - world_from_camera[:3, 3]
        pixels = self.lens.project(outline @ world_from_camera[:3, :3])
        if not np.all(np.isfinite(pixels)):
            return 0, 0, self.width, self.height
        low, high = np.floor(pixels.min(axis=0)) - 2, np.ceil(pixels.max(axis=0)) + 3
        left, top = (int(value) for value in np.clip(low, 0, (self.width, self.height)))
        right, bottom = (int(value) for value in np.clip(high, 0, (self.width, self.height)))
        return left, top, right, bottom

    def _background(self, rays: RayField, world_from_camera: Array) -> Grey:
        """Return a far wall with a soft play of light on it, which turns with the camera's direction."""
        coarse = (slice(1, None, _BACKGROUND_STEP),) * 2
        directions = np.stack([rays.x[coarse], rays.y[coarse], np.ones_like(rays.x[coarse])], axis=-1)
        x, y, z = np.moveaxis(directions @ world_from_camera[:3, :3].T.astype(np.float32), -1, 0)
        light = np.sin(2.1 * x + 1.3 * y) * np.cos(1.7 * y - 0.9 * z) + 0.5 * np.sin(3.1 * y + 2.3 * z)
        grey = np.asarray(self.plate.options.background * (1.0 + 0.12 * light), np.float32)
        return np.asarray(cv2.resize(grey, (self.width, self.height)), np.float32)


def _on_edges(met: Grey) -> NDArray[np.bool_]:
    """Return which pixels may have an edge in them: those that differ from a neighbour."""
    square = np.ones((3, 3), np.uint8)
    mixed: NDArray[np.bool_] = cv2.dilate(met, square) != cv2.erode(met, square)
    return mixed


def _shares(caster: Caster, rays: RayField, pixels: tuple[Indices, Indices]) -> tuple[Grey, Grey]:
    """Return the shares of ink and of paper (n,) in the squares of n pixels (rows and columns in `rays`)."""
    depths = caster.depths(*_rays_within(rays, pixels, CORNERS))
    (ink, ink_doubtful), (paper, paper_doubtful) = (share(depth) for depth in depths)
    doubtful = np.flatnonzero(ink_doubtful | paper_doubtful)
    everywhere = spread(_SAMPLES)
    for first in range(0, len(doubtful), _BATCH):
        some = doubtful[first : first + _BATCH]
        sampled = caster.depths(*_rays_within(rays, (pixels[0][some], pixels[1][some]), everywhere))
        ink[some], paper[some] = (np.mean(depth > 0, axis=1, dtype=np.float32) for depth in sampled)
    return ink, paper


def _rays_within(rays: RayField, pixels: tuple[Indices, Indices], offsets: Grey) -> list[Grey]:
    """Return x and y (n, s) of rays at offsets (s, 2) from n pixels, within which the field is linear."""
    row, column = pixels
    within = []
    for field in (rays.x, rays.y):
        along_u = (field[row, column + 1] - field[row, column - 1]) * np.float32(0.5)
        along_v = (field[row + 1, column] - field[row - 1, column]) * np.float32(0.5)
        ray = np.stack([along_u, along_v], axis=1) @ offsets.T
        ray += field[row, column][:, None]
        within.append(ray)
    return within
