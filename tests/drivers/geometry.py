"""An independent view of the simulated world, by OpenCV's projection, to judge the renderer with."""

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tests.drivers.rigs import DISTORTION

Array = NDArray[np.float64]

K = np.array([[1400.0, 0.0, 633.0], [0.0, 1405.0, 487.0], [0.0, 0.0, 1.0]])


def project(points: ArrayLike, world_from_camera: Array) -> Array:
    """Return the pixels (n, 2) of world points (n, 3) through the tests' lens."""
    camera_from_world = np.linalg.inv(world_from_camera)
    turn, _ = cv2.Rodrigues(camera_from_world[:3, :3])
    shift = camera_from_world[:3, 3]
    return cv2.projectPoints(np.array(points, float), turn, shift, K, np.array(DISTORTION))[0].reshape(-1, 2)


def on_plane(pixels: Array, world_from_camera: Array) -> Array:
    """Return x and y (n, 2) of where the rays of pixels (n, 2) meet the world's plane z = 0."""
    xy_d = (pixels - K[:2, 2]) / (K[0, 0], K[1, 1])
    rays = np.column_stack([xy_d, np.ones(len(pixels))])
    still = np.zeros(3)
    for _ in range(10):  # OpenCV's own inverse stops too early
        distorted, _ = cv2.projectPoints(rays, still, still, np.eye(3), np.array(DISTORTION))
        rays[:, :2] += xy_d - distorted.reshape(-1, 2)
    rays = rays @ world_from_camera[:3, :3].T
    origin = world_from_camera[:3, 3]
    return origin[:2] - rays[:, :2] * (origin[2] / rays[:, 2:])


def disk_centroid(centre: Array, radius: float, world_from_camera: Array) -> tuple[Array, float]:
    """Return the centroid and area (px) of the picture of a disk in the world's plane."""
    angle = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    circle = centre + radius * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    x, y = project(circle, world_from_camera).T
    x2, y2 = np.roll(x, -1), np.roll(y, -1)
    cross = x * y2 - x2 * y
    area = cross.sum() / 2
    return np.array([((x + x2) * cross).sum(), ((y + y2) * cross).sum()]) / (6 * area), abs(area)
