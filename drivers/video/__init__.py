"""Cameras that OpenCV opens: V4L2 devices, streams by URL, and recorded pictures played back.

options    what a profile may say of each
camera     a camera as activecam wants it: a thread that reads without pause, and its newest frame
v4l2       a device of the kernel, stamped by its driver;  controls  what can be set of it, by name
stream     RTSP, MJPEG over HTTP and the like, stamped on arrival
replay     a folder of pictures or a video file, for trying out
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from drivers.video.replay import ReplayCamera as ReplayCamera
    from drivers.video.stream import StreamCamera as StreamCamera
    from drivers.video.v4l2 import V4l2Camera as V4l2Camera

__all__ = ["ReplayCamera", "StreamCamera", "V4l2Camera"]

_HOMES = {
    "ReplayCamera": "drivers.video.replay",
    "StreamCamera": "drivers.video.stream",
    "V4l2Camera": "drivers.video.v4l2",
}


def __getattr__(name: str) -> Any:
    """Import the one that is asked for: each has libraries that the others do without."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
