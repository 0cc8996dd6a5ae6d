"""Where rays meet the plate."""

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.plate import Plate

Array = NDArray[np.float64]
Rays = NDArray[np.float32]

_FAR = 1000.0
"""Metres beyond which a place on the plane is no longer told apart: no plate is that large."""
_BULGE_STEPS = 5
"""Fixed-point steps to a bulging plate; each leaves a share of the error equal to the paper's slope."""


class Caster:
    """Casts the rays of a camera of one pose to the plate."""

    def __init__(self, plate: Plate, world_from_camera: Array) -> None:
        self._plate = plate
        self._turn = world_from_camera[:3, :3].astype(np.float32)
        self._x, self._y, self._z = (float(value) for value in world_from_camera[:3, 3])

    def depths(self, x: Rays, y: Rays) -> tuple[Rays, Rays]:
        """Return how deep the camera's rays (x, y, 1) meet the ink and the paper (m), in their shape."""
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = self._turn
        dz = zx * x + zy * y + zz
        in_front = self._z < 0.0
        towards = dz > 0.0 if in_front else dz < 0.0
        if not towards.all():
            dz = np.where(towards, dz, np.float32(1.0))
        # World x and y that the ray gains per world z.
        slope_x = (xx * x + xy * y + xz) / dz
        slope_y = (yx * x + yy * y + yz) / dz
        at_x, at_y = self._x - slope_x * self._z, self._y - slope_y * self._z
        if self._plate.options.bulge:
            at_x, at_y = self._on_bulge(at_x, at_y, slope_x, slope_y)
        far = np.float32(_FAR)
        np.clip(at_x, -far, far, out=at_x)
        np.clip(at_y, -far, far, out=at_y)
        at_x[~towards] = far
        paper = self._plate.paper_depth(at_x, at_y)
        if not in_front:
            return np.full_like(paper, -far), paper  # the back of the plate is blank
        return self._plate.ink_depth(at_x, at_y), paper

    def _on_bulge(self, x: Rays, y: Rays, slope_x: Rays, slope_y: Rays) -> tuple[Rays, Rays]:
        """Return x and y where rays that meet the plane at x, y meet the paper that stands out of it."""
        at_x, at_y = x, y
        for _ in range(_BULGE_STEPS):
            height = self._plate.height(at_x, at_y)
            at_x, at_y = x + slope_x * height, y + slope_y * height
        return at_x, at_y
