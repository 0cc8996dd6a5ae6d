"""The simulated lens: from camera coordinates to pixels, and from every pixel back to its ray.

Coordinates are normalised: x = X/Z, y = Y/Z in the camera's frame. Suffix u: without distortion, d: with it.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import ArrayLike, NDArray

from drivers.errors import OptionsError
from drivers.simulated.options import LensOptions

Array = NDArray[np.float64]

_NODES = 48
"""Places along each side where the distortion is inverted; Chebyshev polynomials join them to 1e-10 px."""


@dataclass(frozen=True, slots=True)
class Lens:
    """Focal lengths and principal point in pixels, and a distortion of either model."""

    model: Literal["opencv", "division"]
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...]
    """k1 k2 p1 p2 k3 or k1; those left out are 0."""

    @classmethod
    def from_options(cls, options: LensOptions) -> "Lens":
        """Make the lens that the profile describes."""
        return cls(options.model, options.fx, options.fy, options.cx, options.cy, options.distortion)

    def finer(self, times: int) -> "Lens":
        """Return the same lens before pixels that are so many times finer and share the picture's outline."""
        cx, cy = ((centre + 0.5) * times - 0.5 for centre in (self.cx, self.cy))
        return replace(self, fx=times * self.fx, fy=times * self.fy, cx=cx, cy=cy)

    def project(self, points: ArrayLike) -> Array:
        """Return the pixels (n, 2) of points (n, 3) in the camera's frame; nan where no ray goes there."""
        xyz = np.asarray(points, float).reshape(-1, 3)
        with np.errstate(all="ignore"):
            xy_u = np.where(xyz[:, 2:] > 0.0, xyz[:, :2] / xyz[:, 2:], np.nan)
            xy_d = self.distort(xy_u)
            # Beyond its turning point a distortion folds the far field back into the picture.
            folded = ~np.all(np.abs(self.undistort(xy_d) - xy_u) < 1e-6, axis=1)
        xy_d[folded] = np.nan
        return xy_d * (self.fx, self.fy) + (self.cx, self.cy)

    def directions(self, pixels: ArrayLike) -> Array:
        """Return x, y (n, 2) of the rays (x, y, 1) that end in `pixels` (n, 2)."""
        xy_d = (np.asarray(pixels, float).reshape(-1, 2) - (self.cx, self.cy)) / (self.fx, self.fy)
        return self.undistort(xy_d)

    def distort(self, xy: Array) -> Array:
        """Return (n, 2) distorted from (n, 2) undistorted coordinates."""
        if self.model == "division":
            (k1,) = self._k(1)
            r2 = np.sum(xy**2, axis=1, keepdims=True)
            stretch: Array = 2.0 / (1.0 + np.sqrt(1.0 - 4.0 * k1 * r2))
            return xy * stretch
        return _brown(xy, self._k(5))[0]

    def undistort(self, xy: Array) -> Array:
        """Return (n, 2) undistorted from (n, 2) distorted coordinates, to 1e-12; nan where there are none."""
        if self.model == "division":
            (k1,) = self._k(1)
            shrink: Array = 1.0 + k1 * np.sum(xy**2, axis=1, keepdims=True)
            return xy / shrink
        return _invert_brown(xy, self._k(5))

    def _k(self, count: int) -> tuple[float, ...]:
        return self.distortion + (0.0,) * (count - len(self.distortion))


def _brown(xy: Array, k: tuple[float, ...]) -> tuple[Array, Array]:
    """Return OpenCV's distortion of xy (n, 2), and its derivative (n, 2, 2)."""
    k1, k2, p1, p2, k3 = k
    x, y = xy[:, 0], xy[:, 1]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))  # d radial / d x = slope * x
    distorted = np.column_stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ]
    )
    mixed = slope * x * y + 2.0 * (p1 * x + p2 * y)
    jacobian = np.empty((len(xy), 2, 2))
    jacobian[:, 0, 0] = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
    jacobian[:, 0, 1] = jacobian[:, 1, 0] = mixed
    jacobian[:, 1, 1] = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
    return distorted, jacobian


def _invert_brown(xy_d: Array, k: tuple[float, ...]) -> Array:
    """Invert by Newton's method from the distorted point, towards the root nearest the optical axis."""
    xy = xy_d.copy()
    with np.errstate(all="ignore"):
        for _ in range(30):
            distorted, jacobian = _brown(xy, k)
            residual = distorted - xy_d
            determinant = jacobian[:, 0, 0] * jacobian[:, 1, 1] - jacobian[:, 0, 1] ** 2
            step_x = (jacobian[:, 1, 1] * residual[:, 0] - jacobian[:, 0, 1] * residual[:, 1]) / determinant
            step_y = (jacobian[:, 0, 0] * residual[:, 1] - jacobian[:, 0, 1] * residual[:, 0]) / determinant
            xy = xy - np.column_stack([step_x, step_y])
            if not np.nanmax(np.abs(residual), initial=0.0) > 1e-13:
                break
        distorted, jacobian = _brown(xy, k)
        determinant = jacobian[:, 0, 0] * jacobian[:, 1, 1] - jacobian[:, 0, 1] ** 2
        lost = ~((np.abs(distorted - xy_d).max(axis=1) < 1e-11) & (determinant > 0.0))
    xy[lost] = np.nan
    return xy


@dataclass(frozen=True, slots=True)
class RayField:
    """Rays (x, y, 1) of all pixels and of one row and column more on each side: (height + 2, width + 2)."""

    x: NDArray[np.float32]
    y: NDArray[np.float32]


@lru_cache(maxsize=4)
def ray_field(lens: Lens, width: int, height: int) -> RayField:
    """Return every pixel's ray; element [v + 1, u + 1] is that of pixel (u, v).

    Raises OptionsError where the lens has no ray for some pixel of such a picture.
    """
    u, across = _nodes(width)
    v, down = _nodes(height)
    nodes = np.stack(np.meshgrid(u, v, indexing="xy"), axis=-1).reshape(-1, 2)
    rays = lens.directions(nodes).reshape(_NODES, _NODES, 2)
    if not np.all(np.isfinite(rays)):
        raise OptionsError(
            "the simulated lens cannot see all of its picture: its distortion folds over inside; "
            "make the distortion weaker or the focal length longer"
        )
    field = [(down @ rays[:, :, i] @ across.T).astype(np.float32) for i in (0, 1)]
    for array in field:
        array.setflags(write=False)
    return RayField(*field)


def _nodes(pixels: int) -> tuple[Array, Array]:
    """Return nodes from pixel -1 to `pixels`, both included, and what takes values there to those at all pixels."""
    nodes = -np.cos(np.linspace(0.0, np.pi, _NODES))
    everywhere = np.linspace(-1.0, 1.0, pixels + 2)
    degree = _NODES - 1
    at_all = np.linalg.solve(chebvander(nodes, degree).T, chebvander(everywhere, degree).T).T
    return (nodes + 1.0) / 2.0 * (pixels + 1) - 1.0, np.asarray(at_all, float)
