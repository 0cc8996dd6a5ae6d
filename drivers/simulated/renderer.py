"""What the light draws on the sensor: each pixel's ray cast to the plate, averaged over its square.

A pixel that sees one kind of surface needs one ray; one with an edge in it is averaged over many. So edges
lie where the geometry puts them, and disk centres and corners measured in such a picture agree with it.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.simulated.caster import Caster
from drivers.simulated.lens import Lens, RayField, ray_field
from drivers.simulated.plate import BACKGROUND, INK, Plate

Array = NDArray[np.float64]
Grey = NDArray[np.float32]
Indices = NDArray[np.intp]

SAMPLES = 32
"""Rays in a pixel that sees an edge."""
_CHUNK = 4096
"""Pixels averaged at a time, so that their samples stay in the processor's cache."""
_BACKGROUND_STEP = 16
"""Pixels between the places where the smooth background is computed."""


def sample_offsets(count: int) -> Grey:
    """Return places (count, 2) within a pixel, evenly spread and point-symmetric about its centre."""
    # The additive recurrence of the plastic number: no two samples share a row or a column, so that edges
    # along the pixel grid are averaged as finely as slanted ones. Symmetry keeps their mean at the centre.
    index = np.arange(1, count // 2 + 1)
    half = np.column_stack([index * 0.7548776662466927, index * 0.5698402909980532]) % 1.0 - 0.5
    return np.concatenate([half, -half]).astype(np.float32)


@dataclass(frozen=True)
class Renderer:
    """Pictures of one plate through one lens, (height, width) in grey levels."""

    plate: Plate
    lens: Lens
    width: int
    height: int

    def prepare(self) -> None:
        """Invert the lens, which takes longer than many pictures. Raises OptionsError where it has no inverse."""
        ray_field(self.lens, self.width, self.height)

    def render(self, world_from_camera: Array, samples: int = SAMPLES) -> Grey:
        """Return what a camera of this pose (4, 4) sees in an instant, free of blur and noise."""
        rays = ray_field(self.lens, self.width, self.height)
        picture = self._background(rays, world_from_camera)
        left, top, right, bottom = self._window(world_from_camera)
        if left >= right or top >= bottom:
            return picture
        caster = Caster(self.plate, world_from_camera)
        inside = (slice(top + 1, bottom + 1), slice(left + 1, right + 1))
        met = caster.surface(rays.x[inside], rays.y[inside])

        # Shares of ink and of background in each pixel; the rest is paper.
        ink, behind = (met == INK).astype(np.float32), (met == BACKGROUND).astype(np.float32)
        rows, columns = np.nonzero(_mixed(met))
        offsets = sample_offsets(samples)
        for first in range(0, len(rows), _CHUNK):
            r, c = rows[first : first + _CHUNK], columns[first : first + _CHUNK]
            seen = caster.surface(*_rays_within(rays, r + top + 1, c + left + 1, offsets))
            ink[r, c] = np.mean(seen == INK, axis=1, dtype=np.float32)
            behind[r, c] = np.mean(seen == BACKGROUND, axis=1, dtype=np.float32)

        tones = self.plate.options
        view = picture[top:bottom, left:right]
        view -= np.float32(tones.paper)
        view *= behind
        view += np.float32(tones.paper)
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


def _mixed(met: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return which pixels may have an edge in them: those that differ from a neighbour."""
    square = np.ones((3, 3), np.uint8)
    mixed: NDArray[np.bool_] = cv2.dilate(met, square) != cv2.erode(met, square)
    return mixed


def _rays_within(rays: RayField, rows: Indices, columns: Indices, offsets: Grey) -> list[Grey]:
    """Return x and y (n, s) of the rays at `offsets` (s, 2) in n pixels, within which the field is linear."""
    within = []
    for field in (rays.x, rays.y):
        along_u = (field[rows, columns + 1] - field[rows, columns - 1]) * np.float32(0.5)
        along_v = (field[rows + 1, columns] - field[rows - 1, columns]) * np.float32(0.5)
        ray = np.stack([along_u, along_v], axis=1) @ offsets.T
        ray += field[rows, columns][:, None]
        within.append(ray)
    return within
