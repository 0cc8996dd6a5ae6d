"""Where the camera is.

In the order in which an answer is made:

    active       the calibration in use, prepared;  quaternion  rotations as quaternions
    fallback     what is in use where the active one cannot be
    service      the pose now, at a past time, and at given readings;  answers  how it is written
    pixels       world points to pixels, and back to rays
"""

from daemon.pose.active import ActiveCalibration
from daemon.pose.fallback import Fallback
from daemon.pose.service import PoseService

__all__ = ["ActiveCalibration", "Fallback", "PoseService"]
