"""How a flat target lies in the picture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class PlaneView:
    """The homography `picture_from_plane` (3, 3), metres to pixels: rough where a lens bends lines."""

    picture_from_plane: NDArray[np.float64]

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map points (n, 2) in metres to pixels (n, 2)."""
        homogeneous = self._homogeneous(points)
        return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])

    def jacobians(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give matrices (n, 2, 2) in px/m that take small steps at points (n, 2) to the picture."""
        pixels, depth = self.project(points), self._homogeneous(points)[:, 2]
        H = self.picture_from_plane
        return np.asarray((H[:2, :2] - pixels[:, :, None] * H[2, :2]) / depth[:, None, None])

    def scales(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give the pixels per metre (n,) at points (n, 2), where most foreshortened."""
        return np.asarray(np.linalg.svd(self.jacobians(points), compute_uv=False)[:, 1], dtype=np.float64)

    def _homogeneous(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.column_stack([points, np.ones(len(points))]) @ self.picture_from_plane.T)


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
