"""How a flat target lies in the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.smooth import Smooth, smooth

FEWEST = 4  # points that tell a plane's view
NARROWEST = 1e-6  # m; points that are off a line by no more are on it
LENS_STEPS = 5
STANDS_STILL = 0.1  # px, of a step; it leaves less than a tenth of itself, which the rest takes up
UNTOLD = 1e-3  # of what points tell best; what they tell less of the lens is left as it is
REST_DEGREE = 3


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
    """A view through a lens that bends lines: `view` is what is seen without the lens.

    The lens moves places by `distortion` (5,), three radial and two tangential coefficients, about `middle` (2,), from
    where distances are taken in units of `span` px; what it moves otherwise is the `rest`, in px.
    """

    view: PlaneView
    middle: NDArray[np.float64]
    span: float
    distortion: NDArray[np.float64]
    rest: Smooth

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map points (..., 2) in metres to pixels (..., 2)."""
        pixels = self.view.project(points)
        bends = _bends((pixels - self.middle) / self.span) @ self.distortion
        return np.asarray(pixels + self.span * bends + self.rest.at(pixels))

    def shifted(self, step: Sequence[int]) -> BentView:
        """Return the same view in a picture whose places, and the lens's, are (2,) px further."""
        shift = np.array([[1.0, 0, step[0]], [0, 1, step[1]], [0, 0, 1]])
        rest = replace(self.rest, middle=self.rest.middle + step)
        return replace(self, view=self.view.moved(shift), middle=self.middle + step, rest=rest)

    def moved(self, homography: NDArray[np.float64]) -> BentView:
        """Return the view of the same plane, moved by a homography (3, 3) of the picture, through the same lens."""
        return replace(self, view=self.view.moved(homography))


def bent_view(
    view: PlaneView, points: NDArray[np.float64], pixels: NDArray[np.float64], middle: NDArray[np.float64]
) -> BentView:
    """Fit view and lens to the pixels (n, 2) of points (n, 2), from a view that is about right.

    `middle` (2,) is about where the lens looks. What few points do not tell is left out.
    """
    span = max(float(np.abs(pixels - middle).max()), 1.0)
    to_pixels = np.array([[span, 0, middle[0]], [0, span, middle[1]], [0, 0, 1]])
    H = np.linalg.inv(to_pixels) @ view.picture_from_plane
    seen = (pixels - middle) / span
    distortion = np.zeros(5)
    for _ in range(LENS_STEPS):
        at = PlaneView(H).project(points)
        bends = _bends(at)
        off = seen - at - bends @ distortion
        # As if the lens changed small changes of the homography by nothing: the next step mends it.
        slopes = np.concatenate([_small_changes(at), bends], axis=-1).reshape(-1, 13)
        change = np.linalg.lstsq(slopes, off.ravel(), rcond=UNTOLD)[0]
        H = (np.eye(3) + np.append(change[:8], 0).reshape(3, 3)) @ H
        distortion = distortion + change[8:]
        if span * np.abs(slopes @ change).max() < STANDS_STILL:
            break
    at = PlaneView(H).project(points)
    without_lens = PlaneView(to_pixels @ H)
    off = span * (seen - at - _bends(at) @ distortion)
    return BentView(without_lens, middle, span, distortion, smooth(middle + span * at, off, REST_DEGREE))


def _bends(at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give by how much (..., 2, 5) each of a lens' coefficients moves places (..., 2): Brown's, as in `BentView`."""
    x, y = at[..., 0], at[..., 1]
    squares = x * x + y * y
    bends = np.empty((*at.shape, 5))
    np.multiply(at, squares[..., None], out=bends[..., 0])
    np.multiply(bends[..., 0], squares[..., None], out=bends[..., 1])
    np.multiply(bends[..., 1], squares[..., None], out=bends[..., 2])
    bends[..., 0, 3] = bends[..., 1, 4] = 2 * x * y
    bends[..., 0, 4] = squares + 2 * x * x
    bends[..., 1, 3] = squares + 2 * y * y
    return bends


def _small_changes(at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give by how much (n, 2, 8) the entries of a homography near to identity, but the last, move places (n, 2)."""
    changes = np.zeros((len(at), 2, 8))
    for axis, first in enumerate((0, 3)):
        changes[:, axis, first : first + 2] = at
        changes[:, axis, first + 2] = 1
    np.multiply(-at[:, :, None], at[:, None], out=changes[:, :, 6:])
    return changes


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
