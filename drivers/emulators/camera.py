"""A network camera without the camera: MJPEG over HTTP, of what the simulated world's camera sees."""

import asyncio
import contextlib
import math
from collections.abc import Coroutine, Mapping
from dataclasses import dataclass
from typing import Any, Final, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera import CameraSpec
from drivers.driver import DriverContext
from drivers.emulators.emulator import Fault
from drivers.errors import OptionsError
from drivers.simulated.exposure import Exposure
from drivers.simulated.world import SimulatedWorld
from drivers.video.options import StreamOptions, V4l2Options

QUALITY: Final = 95
"""Of the JPEG pictures: edges stay where they are to some thousandths of a pixel."""
LATENCY: Final = "2 s"
"""What a profile is to state where it states none: a picture is rendered after its exposure, which takes a while."""
INSTANTS: Final = 3
"""Of how many a blurred picture is made: enough to be useless, and rendered in time."""
_BOUNDARY: Final = b"frame"
_HEAD: Final = (
    b"HTTP/1.0 200 OK\r\nCache-Control: no-store\r\nConnection: close\r\n"
    b"Content-Type: multipart/x-mixed-replace; boundary=" + _BOUNDARY + b"\r\n\r\n"
)


@dataclass(frozen=True, slots=True)
class Shot:
    """A picture as it is sent, and when its exposure began (world's clock, s)."""

    jpeg: bytes
    began: float


class StreamEmulator:
    """Sends every client the newest picture at the world's frame rate, or as often as it can be rendered."""

    def __init__(self, spec: CameraSpec, keys: Mapping[str, object], world: SimulatedWorld) -> None:
        """`keys` are the profile's options for the camera, without its address."""
        self.lateness = 0.0
        """How much later than usual pictures are sent (s)."""
        self.frozen = self.repeating = self.truncated = False
        self.port = 0
        self._keys = keys
        self._world = world
        self._exposure = Exposure(world, spec.width, spec.height, INSTANTS)
        picture = world.options.camera.picture
        self._period, self._duration = 1.0 / picture.frame_rate, picture.exposure
        self._shot: Shot | None = None
        self._news = asyncio.Event()
        self._clients: set[asyncio.Task[None]] = set()
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    @classmethod
    def create(cls, spec: CameraSpec, options: StreamOptions | V4l2Options, context: DriverContext) -> Self:
        """Make what stands in for a stream, or, by a stream, for a V4L2 camera. Raises OptionsError."""
        if context.world is None:
            raise OptionsError("an emulated camera needs a world: add a [simulation] table to the profile")
        keys: Mapping[str, object] = {"latency": LATENCY}
        if isinstance(options, StreamOptions):
            keys = options.model_dump(mode="json", exclude_unset=True, exclude={"url"})
        return cls(spec, keys, context.world)

    @property
    def url(self) -> str:
        """Where the stream is."""
        return f"http://127.0.0.1:{self.port}/stream.mjpg"

    @property
    def faults(self) -> Mapping[str, Fault]:
        """What it can be told to do wrong; `repair` undoes all of it."""
        return {
            "freeze": Fault("it sends nothing more", self.freeze),
            "repeat": Fault("it sends one picture again and again", self.repeat),
            "truncate": Fault("it sends the first half of each picture", self.truncate),
            "late": Fault("it sends each picture that much later", self.delay, "SECONDS"),
            "unplug": Fault("it is gone, and connections are refused", self.unplug),
            "repair": Fault("all is well again", self.repair),
        }

    async def start(self) -> Mapping[str, object]:
        """Take connections. Raises OptionsError where the world's lens cannot be rendered."""
        await asyncio.to_thread(self._exposure.prepare)
        await self._listen()
        self._keep(self._expose())
        return {"driver": "stream", "options": {"url": self.url, **self._keys}}

    async def close(self) -> None:
        """Drop everybody."""
        self.unplug()
        ending = [*self._tasks, *self._clients]
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*ending, return_exceptions=True)

    def freeze(self) -> None:
        """Send nothing more to anybody, and let the connections stand."""
        self.frozen = True

    def repeat(self) -> None:
        """Send the latest picture instead of new ones."""
        self.repeating = True

    def truncate(self) -> None:
        """Cut off half of each picture's bytes."""
        self.truncated = True

    def delay(self, seconds: str | float) -> None:
        """Send each picture `seconds` later than usual."""
        self.lateness = float(seconds)

    def unplug(self) -> None:
        """Drop every connection, and refuse new ones."""
        server, self._server = self._server, None
        if server is not None:
            server.close()
        for client in self._clients:
            client.cancel()

    def repair(self) -> None:
        """Undo every fault."""
        self.frozen = self.repeating = self.truncated = False
        self.lateness = 0.0
        if self._server is None:
            self._keep(self._listen())

    def _keep(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _listen(self) -> None:
        self._server = await asyncio.start_server(self._welcome, "127.0.0.1", self.port)
        self.port = self._server.sockets[0].getsockname()[1]

    async def _expose(self) -> None:
        """Take one picture after another, while somebody looks."""
        clock = self._world.clock
        loop = asyncio.get_running_loop()
        while True:
            number = math.ceil(clock.now() / self._period)
            began = number * self._period
            await clock.sleep(began + self._duration - clock.now())
            if not self._clients:
                continue
            # The axes' past is read here: the rendering thread never touches the world's state.
            poses = self._exposure.poses(began, self._duration)
            noise = np.random.default_rng([self._world.options.seed, number])
            shot = Shot(await asyncio.to_thread(self._picture, poses, noise), began)
            loop.call_later(self.lateness, self._publish, shot)

    def _picture(self, poses: list[NDArray[np.float64]], noise: np.random.Generator) -> bytes:
        image = self._exposure.picture(poses, noise)
        return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()

    def _publish(self, shot: Shot) -> None:
        if self.frozen:
            return
        if not self.repeating or self._shot is None:
            self._shot = shot
        self._news.set()
        self._news = asyncio.Event()

    async def _welcome(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        client = asyncio.current_task()
        assert client is not None
        self._clients.add(client)
        try:
            # A client that leaves, and one that is dropped, end alike.
            with contextlib.suppress(ConnectionError, asyncio.CancelledError, asyncio.IncompleteReadError):
                await reader.readuntil(b"\r\n\r\n")
                writer.write(_HEAD)
                await self._send(writer)
        finally:
            self._clients.discard(client)
            writer.transport.abort()

    async def _send(self, writer: asyncio.StreamWriter) -> None:
        while True:
            await self._news.wait()
            assert self._shot is not None
            jpeg = self._shot.jpeg
            if self.truncated:
                jpeg = jpeg[: len(jpeg) // 2]
            writer.write(
                b"--%s\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\nX-Timestamp: %.6f\r\n\r\n%s\r\n"
                % (_BOUNDARY, len(jpeg), self._shot.began, jpeg)
            )
            await writer.drain()
