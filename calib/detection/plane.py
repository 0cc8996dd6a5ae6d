"""How a flat target lies in the picture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.smooth import Smooth, smooth

FEWEST = 4  # points that tell a plane's view
NARROWEST = 1e-6  # m; points that are off a line by no more are on it


@dataclass(frozen=True, eq=False)
class PlaneView:
    """The homography `picture_from_plane` (3, 3), metres to pixels: rough where a lens bends lines."""

    picture_from_plane: NDArray[np.float64]

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map points (..., 2) in metres to pixels (..., 2)."""
        H = self.picture_from_plane
        homogeneous = points @ H[:, :2].T + H[:, 2]
        return np.asarray(homogeneous[..., :2] / homogeneous[..., 2:])

    def moved(self, homography: NDArray[np.float64]) -> PlaneView:
        """Return the view of the same plane in a picture that a homography (3, 3) has moved."""
        return PlaneView(homography @ self.picture_from_plane)

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
    """A view through a lens that bends lines: `view`, and by how much (px) what is seen is off its pixels."""

    view: PlaneView
    bend: Smooth

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map points (..., 2) in metres to pixels (..., 2)."""
        pixels = self.view.project(points)
        return pixels + self.bend.at(pixels)


def bent_view(
    view: PlaneView, points: NDArray[np.float64], pixels: NDArray[np.float64], degree: int = 3
) -> BentView:
    """Fit what the pixels (n, 2) of points (n, 2) are off the view, by polynomials of such a degree at most."""
    seen = view.project(points)
    return BentView(view, smooth(seen, pixels - seen, degree))


def span_a_plane(points: NDArray[np.float64]) -> bool:
    """Tell whether points (n, 2), in m, are four or more that are not on one line."""
    if len(points) < FEWEST:
        return False
    off = points - points.mean(axis=0)
    return bool(np.linalg.eigvalsh(off.T @ off)[0] > NARROWEST**2)


def view_of_plane(points: NDArray[np.float64], pixels: NDArray[np.float64]) -> PlaneView | None:
    """Fit the view to all points (n, 2) and their pixels; None where the points do not span a plane."""
    if not span_a_plane(points):
        return None
    homography, _ = cv2.findHomography(points, pixels)
    return _view(homography)


def view_of_most(
    points: NDArray[np.float64], pixels: NDArray[np.float64], tolerance: float
) -> tuple[PlaneView, NDArray[np.bool_]] | None:
    """Fit the view to the most points that agree to `tolerance` (px); give it, and which (n,) they are."""
    if len(points) < FEWEST:
        return None
    homography, agreeing = cv2.findHomography(points, pixels, cv2.RANSAC, tolerance)
    view = _view(homography)
    return None if view is None else (view, np.asarray(agreeing).ravel().astype(bool))


def _view(homography: cv2.typing.MatLike | None) -> PlaneView | None:
    # OpenCV says None, or a matrix of no use, where the points have no homography.
    if homography is None or homography.shape != (3, 3) or not np.all(np.isfinite(homography)):
        return None
    return PlaneView(np.asarray(homography, dtype=np.float64))
