"""Pictures of targets: drawn flat at high resolution, then warped by a pinhole's homography."""

from dataclasses import dataclass
from functools import lru_cache
from math import floor

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.targets import (
    AprilGrid,
    AsymmetricCircleGrid,
    Charuco,
    Chessboard,
    CircleGrid,
    Target,
    target_points,
)

PAPER, INK, WALL = 225.0, 25.0, 120.0
SUPERSAMPLING = 4


@dataclass(frozen=True, eq=False)
class Drawn:
    """A picture, and the truth about it."""

    picture: NDArray[np.uint8]
    picture_from_world: NDArray[np.float64]  # homography of the plane Z = 0 to pixels
    points: NDArray[np.float64]  # (n, 2) pictures of the target's points, by id

    def disk_centroids(self, target: CircleGrid | AsymmetricCircleGrid) -> NDArray[np.float64]:
        """Centres (n, 2) of the ellipses that are the disks' pictures, from their conics."""
        world_from_picture = np.linalg.inv(self.picture_from_world)
        centroids = []
        for x, y, _ in target_points(target):
            radius = target.disk_diameter / 2
            disk = np.array([[1, 0, -x], [0, 1, -y], [-x, -y, x * x + y * y - radius**2]])
            conic = world_from_picture.T @ disk @ world_from_picture
            centroids.append(np.linalg.solve(conic[:2, :2], -conic[:2, 2]))
        return np.array(centroids)


@dataclass(frozen=True, eq=False)
class Plate:
    """A flat drawing, 0 where there is ink and 1 where there is paper, and where it lies in the world."""

    drawing: NDArray[np.float32]
    world_from_plate: NDArray[np.float64]  # homography of plate pixels to the plane Z = 0


def draw(
    target: Target,
    *,
    roll: float = 0.0,
    tilt: tuple[float, float] = (0.0, 0.0),
    fill: float = 0.7,
    shift: tuple[float, float] = (0.0, 0.0),
    size: tuple[int, int] = (640, 480),
    blur: float = 0.7,
    noise: float = 0.0,
    shading: float = 0.0,
    inverted: bool = False,
    seed: int = 0,
) -> Drawn:
    """Draw the target before a grey wall.

    It is tilted about its own x and y axes and rolled about the line of sight (degrees), its points span
    `fill` of the picture's height, shifted (px) from its middle. `blur` and `noise` are standard deviations
    (px, grey values); `shading` is the loss of light from the left edge to the right one.
    """
    width, height = size
    points = target_points(target)
    middle = points.mean(axis=0)
    focal = 1.5 * width
    distance = focal * np.ptp(points[:, :2], axis=0).max() / (fill * height)
    roll_matrix, *tilts = (
        cv2.Rodrigues(np.radians(angle) * axis)[0]
        for angle, axis in zip((roll, *tilt), np.eye(3)[[2, 0, 1]], strict=True)
    )
    rotation = roll_matrix @ tilts[0] @ tilts[1]
    K = np.array([[focal, 0, width / 2 - 0.5 + shift[0]], [0, focal, height / 2 - 0.5 + shift[1]], [0, 0, 1]])
    translation = np.array([0, 0, distance]) - rotation @ middle
    H = K @ np.column_stack([rotation[:, 0], rotation[:, 1], translation])

    plate = _plate(target)
    s = SUPERSAMPLING
    fine_from_picture = np.array([[s, 0, (s - 1) / 2], [0, s, (s - 1) / 2], [0, 0, 1]])
    fine_from_plate = fine_from_picture @ H @ plate.world_from_plate
    drawing = 1 - plate.drawing if inverted else plate.drawing
    fine = cv2.warpPerspective(
        drawing, fine_from_plate, (s * width, s * height), flags=cv2.INTER_LINEAR, borderValue=(-1.0,)
    )
    fine = np.where(fine < 0, WALL, INK + (PAPER - INK) * fine)
    # A lens blurs the light before pixels gather it; the other way round, places would depend on where pixels lie.
    if blur:
        fine = cv2.GaussianBlur(fine, (0, 0), s * blur)
    grey = cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA)
    grey = grey * (1 - shading * np.linspace(0, 1, width))
    grey = grey + noise * np.random.default_rng(seed).standard_normal(grey.shape)
    picture = np.clip(np.rint(grey), 0, 255).astype(np.uint8)
    return Drawn(picture, H, project(H, points[:, :2]))


def project(H: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Map points (n, 2) by a homography."""
    homogeneous = np.column_stack([points, np.ones(len(points))]) @ H.T
    return homogeneous[:, :2] / homogeneous[:, 2:]


@lru_cache(maxsize=16)
def _plate(target: Target) -> Plate:
    match target:
        case CircleGrid() | AsymmetricCircleGrid():
            return _disks(target)
        case Chessboard():
            cells = np.kron(
                np.indices((target.rows + 1, target.columns + 1)).sum(axis=0) % 2, np.ones((120, 120))
            )
            return _framed(cells.astype(np.float32), 120 / target.pitch, (-target.pitch, -target.pitch), 60)
        case Charuco():
            dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, target.dictionary))
            shape = (target.columns, target.rows)
            board = cv2.aruco.CharucoBoard(shape, target.pitch, target.marker, dictionary)
            cells = board.generateImage((140 * target.columns, 140 * target.rows)).astype(np.float32) / 255
            return _framed(cells, 140 / target.pitch, (-target.pitch, -target.pitch), 60)
        case AprilGrid():
            return _tags(target)
    raise AssertionError(target)


def _disks(target: CircleGrid | AsymmetricCircleGrid) -> Plate:
    scale = 150 / target.pitch
    margin = floor(0.8 * 150)
    centres = target_points(target)[:, :2] * scale
    width, height = np.ceil(centres.max(axis=0)).astype(int) + 1
    x, y = np.meshgrid(np.arange(width + 2 * margin) - margin, np.arange(height + 2 * margin) - margin)
    drawing = np.ones(x.shape, dtype=np.float32)
    radius = target.disk_diameter / 2 * scale
    for centre in centres:
        reach = floor(radius) + 3
        left, top = np.rint(centre).astype(int) + margin - reach
        window = np.s_[top : top + 2 * reach + 1, left : left + 2 * reach + 1]
        outside = np.hypot(x[window] - centre[0], y[window] - centre[1]) - radius
        drawing[window] = np.clip(0.5 + outside, 0, 1)
    return Plate(
        drawing, np.array([[1 / scale, 0, -margin / scale], [0, 1 / scale, -margin / scale], [0, 0, 1]])
    )


def _tags(target: AprilGrid) -> Plate:
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, target.dictionary))
    side = 160
    step = round(side * target.pitch / target.tag)
    drawing = np.ones((step * (target.rows - 1) + side, step * (target.columns - 1) + side), dtype=np.float32)
    for tag in range(target.rows * target.columns):
        row, column = divmod(tag, target.columns)
        marker = cv2.aruco.generateImageMarker(dictionary, tag, side)
        drawing[row * step : row * step + side, column * step : column * step + side] = marker / 255
    return _framed(drawing, side / target.tag, (0.0, 0.0), 50)


def _framed(drawing: NDArray[np.float32], scale: float, origin: tuple[float, float], frame: int) -> Plate:
    """Frame a drawing (`scale` px/m) with paper (`frame` px); its top left corner is at `origin` (m)."""
    framed = cv2.copyMakeBorder(drawing, frame, frame, frame, frame, cv2.BORDER_CONSTANT, value=(1.0,))
    x, y = ((0.5 - frame) / scale + origin[0], (0.5 - frame) / scale + origin[1])
    return Plate(framed, np.array([[1 / scale, 0, x], [0, 1 / scale, y], [0, 0, 1]]))
