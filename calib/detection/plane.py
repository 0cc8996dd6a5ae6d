"""How a flat target lies in the picture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

POINTS_A_TERM = 2  # of the lens' bend; fewer would be bent to their own errors


@dataclass(frozen=True, eq=False)
class PlaneView:
    """The homography `picture_from_plane` (3, 3), metres to pixels: rough where a lens bends lines."""

    picture_from_plane: NDArray[np.float64]

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map points (..., 2) in metres to pixels (..., 2)."""
        H = self.picture_from_plane
        homogeneous = points @ H[:, :2].T + H[:, 2]
        return np.asarray(homogeneous[..., :2] / homogeneous[..., 2:])

    def jacobians(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give matrices (n, 2, 2) in px/m that take small steps at points (n, 2) to the picture."""
        H = self.picture_from_plane
        pixels, depth = self.project(points), points @ H[2, :2] + H[2, 2]
        return np.asarray((H[:2, :2] - pixels[:, :, None] * H[2, :2]) / depth[:, None, None])

    def scales(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give the pixels per metre (n,) at points (n, 2), where most foreshortened."""
        return np.asarray(np.linalg.svd(self.jacobians(points), compute_uv=False)[:, 1], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class BentView:
    """A view through a lens that bends lines: `view`, and the cubic by which the points seen are off it.

    The cubic is one in the pixels of the view, less `middle` (2,) and divided by `span`; its `bend` (k, 2) are the
    coefficients, px, of as many terms as the points allowed.
    """

    view: PlaneView
    middle: NDArray[np.float64]
    span: float
    bend: NDArray[np.float64]

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map points (..., 2) in metres to pixels (..., 2)."""
        pixels = self.view.project(points)
        return np.asarray(pixels + _terms((pixels - self.middle) / self.span, len(self.bend)) @ self.bend)


def bent_view(view: PlaneView, points: NDArray[np.float64], pixels: NDArray[np.float64]) -> BentView:
    """Fit what the pixels (n, 2) of points (n, 2) are off the view: a cubic, or less where they are few."""
    seen = view.project(points)
    middle = seen.mean(axis=0)
    span = max(float(np.abs(seen - middle).max()), 1.0)
    count = next(terms for terms in (10, 6, 3, 0) if len(points) >= POINTS_A_TERM * terms)
    terms = _terms((seen - middle) / span, count)
    bend = np.asarray(np.linalg.lstsq(terms, pixels - seen, rcond=None)[0], dtype=np.float64)
    return BentView(view, middle, span, bend)


def _terms(at: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Give the first so many powers x^i y^j (..., count) of places (..., 2), by growing degree."""
    powers = [(degree - j, j) for degree in range(4) for j in range(degree + 1)][:count]
    x, y = at[..., 0], at[..., 1]
    return np.stack([x**i * y**j for i, j in powers], axis=-1) if powers else np.empty((*x.shape, 0))


def view_of_plane(points: NDArray[np.float64], pixels: NDArray[np.float64]) -> PlaneView | None:
    """Fit the view to all points (n, 2) and their pixels; None where the points do not span a plane."""
    if len(points) < 4 or np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-9) < 2:
        return None
    homography, _ = cv2.findHomography(points, pixels)
    return _view(homography)


def view_of_most(
    points: NDArray[np.float64], pixels: NDArray[np.float64], tolerance: float
) -> tuple[PlaneView, NDArray[np.bool_]] | None:
    """Fit the view to the most points that agree to `tolerance` (px); give it, and which (n,) they are."""
    if len(points) < 4:
        return None
    homography, agreeing = cv2.findHomography(points, pixels, cv2.RANSAC, tolerance)
    view = _view(homography)
    return None if view is None else (view, np.asarray(agreeing).ravel().astype(bool))


def _view(homography: cv2.typing.MatLike | None) -> PlaneView | None:
    # OpenCV says None, or a matrix of no use, where the points have no homography.
    if homography is None or homography.shape != (3, 3) or not np.all(np.isfinite(homography)):
        return None
    return PlaneView(np.asarray(homography, dtype=np.float64))
