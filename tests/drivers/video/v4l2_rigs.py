"""The V4L2 driver on a camera that is made up."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from drivers.camera import CameraSpec
from drivers.clock import SystemClock
from drivers.video.camera import VideoCamera
from drivers.video.options import V4l2Options
from drivers.video.v4l2 import V4l2Source
from tests.drivers.video.captures import WEBCAM, FakeCapture, FakeNode

SPEC = CameraSpec("eye", 64, 48)


class Rig:
    """A camera, the fake device behind it, and how often it was opened."""

    def __init__(
        self,
        capture: FakeCapture | None = None,
        node: FakeNode | None = None,
        spec: CameraSpec = SPEC,
        **options: Any,
    ) -> None:
        self.capture = FakeCapture() if capture is None else capture
        self.node = FakeNode(WEBCAM) if node is None else node
        self.opened = 0
        whole = {"device": "/dev/null", "timeout": "1 s", "latency": "1 ms", "exposure": "5 ms"} | options
        self.options = V4l2Options.model_validate(whole)
        source = V4l2Source(spec, self.options, lambda _camera, _device: self.node, self._open)
        self.camera = VideoCamera(spec, source, SystemClock(), self.options.timeout)

    def _open(self, device: str) -> FakeCapture:
        self.opened += 1
        return self.capture.reopened()

    @asynccontextmanager
    async def open(self) -> AsyncIterator[VideoCamera]:
        await self.camera.open()
        try:
            yield self.camera
        finally:
            await self.camera.close()
