"""A client of an activecam daemon: where is the camera, what does it see where, and, for who may, moving it.

client       what can be asked, and calibration runs
lease        the right to move, kept for as long as it is needed
run          a calibration run and its events
connection   requests, the pose stream, and what goes wrong with both
documents    the answers;  errors  the problems

with Client("http://localhost:8080") as camera:
    print(camera.pose().position)
"""

from activecam_client.client import Client
from activecam_client.documents import (
    Axis,
    CalibrationEntry,
    Check,
    Comparison,
    Event,
    PastPose,
    Pose,
    Rays,
    Rig,
    RunRecord,
    Stop,
    StreamedPose,
    View,
)
from activecam_client.errors import ActivecamError, ProblemError, UnreachableError
from activecam_client.lease import Lease
from activecam_client.run import Run

__all__ = [
    "ActivecamError",
    "Axis",
    "CalibrationEntry",
    "Check",
    "Client",
    "Comparison",
    "Event",
    "Lease",
    "PastPose",
    "Pose",
    "ProblemError",
    "Rays",
    "Rig",
    "Run",
    "RunRecord",
    "Stop",
    "StreamedPose",
    "UnreachableError",
    "View",
]
