"""A camera's pose from one view of a plane, wherever it stands."""

import numpy as np
import pytest

from calib.pose_from_view import pose_from_view
from calib.session import Intrinsics
from calib.transforms import pose_error
from calib.twists import exp_twist
from tests.calib.scenes import DISK_CENTRES, FOCAL, HEIGHT, WIDTH, look_at, project

LENS = Intrinsics(model="opencv", fx=FOCAL, fy=FOCAL, cx=WIDTH / 2, cy=HEIGHT / 2, distortion=[0.0] * 5)


@pytest.mark.parametrize("roll", range(0, 360, 10))
def test_a_plane_whose_middle_is_seen_right_ahead(roll: int) -> None:
    """Where it is seen there exactly, the usual closed form divides nought by nought."""
    middle = DISK_CENTRES.mean(axis=0)
    ahead = look_at(middle + np.array([0.0, -0.5, -0.9]), middle)
    pose = ahead @ exp_twist(np.array([0, 0, np.radians(roll), 0, 0, 0]))
    found = pose_from_view(DISK_CENTRES, project(DISK_CENTRES, pose), LENS)
    distance, angle = pose_error(found[None], pose[None])
    assert distance.max() < 1e-6
    assert angle.max() < 1e-6
