"""What a profile may say of a video camera, in its `options`."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from drivers.options import DriverOptions
from drivers.quantities import PositiveDuration, PositiveFrequency, written


class V4l2Options(DriverOptions):
    """Keys of a camera with `driver = "v4l2"`. What is not given stays as the camera has it."""

    device: Annotated[
        str, Field(pattern="^/dev/", examples=["/dev/v4l/by-id/usb-Acme_Camera_0123-video-index0"])
    ]
    """A link below /dev/v4l/by-id or by-path, which stays the same when the numbers of /dev/video* do not."""
    pixel_format: Annotated[str, Field(pattern="^[ -~]{4}$", examples=["MJPG", "YUYV"])] | None = None
    """The four characters that `v4l2-ctl --list-formats` shows."""
    frame_rate: PositiveFrequency | None = None
    buffers: Annotated[int, Field(ge=1, le=32)] | None = None
    """Frames that the driver may keep waiting."""
    exposure: PositiveDuration | None = None
    """Set where the camera lets it be set; believed where it can't be read."""
    latency: PositiveDuration | None = None
    """From an exposure's end to its stamp: readout and packing. None takes one frame's time."""
    controls: dict[str, int] = Field(default_factory=dict)
    """By the names and in the units of `v4l2-ctl --list-ctrls`."""
    timeout: PositiveDuration = written("2 s")
    """How long a frame may be overdue before the camera counts as lost."""


class StreamOptions(DriverOptions):
    """Keys of a camera with `driver = "stream"`."""

    url: Annotated[str, Field(pattern="^[a-z]+://", examples=["http://192.168.1.30:8080/?action=stream"])]
    latency: PositiveDuration
    """What at most passes from an exposure's end to a frame's arrival here: twice of what was measured."""
    exposure: PositiveDuration = written("40 ms")
    """Its longest."""
    timeout: PositiveDuration = written("5 s")
    """How long the stream may take to open, and a frame to come, before the camera counts as lost."""


class ReplayOptions(DriverOptions):
    """Keys of a camera with `driver = "replay"`."""

    path: Path = Field(strict=False, examples=["activecam-data/sessions/20260314-092653-1f2e3d/frames"])
    """A folder of pictures, shown in the order of their names, or a video file."""
    frame_rate: PositiveFrequency = written("10 Hz")
    loop: bool = True
    """Whether it begins again after the last picture."""
