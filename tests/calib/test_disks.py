"""The centroid of a disk's picture, against the picture's area summed up bit by bit."""

import numpy as np
from scipy.spatial.transform import Rotation

from calib.disks import centroid_offsets
from calib.lens import project_points
from calib.session import Intrinsics
from calib.transforms import transform

LENS = Intrinsics(
    model="opencv", fx=800, fy=810, cx=320, cy=240, distortion=[-0.26, 0.1, 0.001, -0.0005, 0.02]
)


def test_offset_is_that_of_the_area() -> None:
    camera_from_world = transform(Rotation.from_rotvec([0.5, 0.3, 0.1]).as_matrix(), [-0.1, -0.05, 0.6])
    centre, radius = np.array([0.15, 0.1, 0.0]), 0.015

    def seen(flat: np.ndarray) -> np.ndarray:
        world = np.column_stack([flat, np.zeros(len(flat))]) + centre
        return project_points(world @ camera_from_world[:3, :3].T + camera_from_world[:3, 3], LENS)

    radii, angles = np.sqrt((np.arange(200) + 0.5) / 200), 2 * np.pi * np.arange(64) / 64
    bits = radius * np.column_stack(
        [np.outer(radii, np.cos(angles)).ravel(), np.outer(radii, np.sin(angles)).ravel()]
    )
    step = 1e-6
    along = (seen(bits + np.array([step, 0])) - seen(bits - np.array([step, 0]))) / (2 * step)
    across = (seen(bits + np.array([0, step])) - seen(bits - np.array([0, step]))) / (2 * step)
    area = np.abs(along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0])
    expected = area @ seen(bits) / area.sum() - seen(np.zeros((1, 2)))[0]

    offset = centroid_offsets(centre[None], camera_from_world, 2 * radius, LENS)[0]
    assert np.linalg.norm(expected) > 0.1
    assert np.allclose(offset, expected, atol=1e-6)


def test_facing_disk_without_distortion_has_none() -> None:
    lens = LENS.model_copy(update={"distortion": [0.0] * 5})
    offset = centroid_offsets(np.zeros((1, 3)), transform(np.eye(3), [0.05, 0.02, 0.5]), 0.03, lens)
    assert np.allclose(offset, 0, atol=1e-12)
