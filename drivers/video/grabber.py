"""One opening of a video source: the thread that reads without pause, and the newest frame."""

import asyncio
import contextlib
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Final

from drivers.camera import Frame
from drivers.errors import DeviceLostError, DeviceTimeoutError
from drivers.video.source import Picture, Source

FIRST_PAUSE: Final = 0.005
LONGEST_PAUSE: Final = 0.2
"""Seconds between two reads that bring nothing: a device that is gone answers at once, and for ever."""
JOIN_LIMIT: Final = 15.0
"""Seconds, beyond the time-out that libraries are given, for which a read may hold up the closing."""


class Grabber:
    """Reads a source in a thread of its own from `start` to `stop`.

    Frames are read whether anybody wants them or not, since those that are not read grow old in buffers.
    """

    def __init__(
        self,
        name: str,
        source: Source,
        timeout: float,
        numbers: Iterator[int],
        to_rig: Callable[[float], float],
    ) -> None:
        """`to_rig` turns CLOCK_MONOTONIC into the rig's clock (s); `timeout` (s) is how long frames may stay away."""
        self.newest: Frame | None = None
        self.warnings: Sequence[str] = ()
        self._name = name
        self._source = source
        self._timeout = timeout
        self._numbers = numbers
        self._to_rig = to_rig
        self._loop = asyncio.get_running_loop()
        self._news: asyncio.Future[None] = self._loop.create_future()
        self._error: Exception | None = None
        self._opened = False
        self._latest = 0.0
        """CLOCK_MONOTONIC when the latest picture came, or when the source was open."""
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"camera {name}", daemon=True)

    async def start(self) -> None:
        """Return when the first frame is there; raises what the source raises, and DeviceLostError."""
        self._thread.start()
        while self.newest is None:
            self.require_alive()
            await self.news()

    async def news(self) -> None:
        """Wait for the next frame or the end, and no longer than until it can be said that none comes."""
        await asyncio.wait([self._news], timeout=self._timeout)

    async def stop(self) -> None:
        """Return when the thread has let the source go; who waits for news finds at once that there are none."""
        self._stopping.set()
        self._wake()
        limit = self._timeout + JOIN_LIMIT
        await asyncio.to_thread(self._thread.join, limit)
        if self._thread.is_alive():
            raise DeviceTimeoutError(
                f"camera '{self._name}' has not let go for {limit:g} s: unplug it, or restart the program"
            )

    def require_alive(self) -> None:
        """Raise DeviceLostError once there will be nothing more, and the newest frame is an old one."""
        if self._error is not None:
            raise self._error
        if self._opened and time.monotonic() - self._latest > self._timeout:
            raise DeviceLostError(
                f"camera '{self._name}' has delivered no new frame for {self._timeout:g} s: "
                "check its cable, its power, and that its lens is not covered"
            )

    def _run(self) -> None:
        try:
            warnings = self._source.open()
            self._latest, self._opened = time.monotonic(), True
            self._tell(self._begin, warnings)
            self._read()
        except Exception as error:  # whatever a library raises has to reach those who wait
            self._tell(self._fail, self._as_loss(error))
        finally:
            self._source.close()

    def _read(self) -> None:
        pause = FIRST_PAUSE
        while not self._stopping.is_set():
            picture = self._source.read()
            if picture is None:
                self._stopping.wait(pause)
                pause = min(2 * pause, LONGEST_PAUSE)
            else:
                pause = FIRST_PAUSE
                self._latest = time.monotonic()
                self._tell(self._deliver, picture)

    def _as_loss(self, error: Exception) -> Exception:
        if not self._opened or isinstance(error, DeviceLostError):
            return error
        loss = DeviceLostError(f"camera '{self._name}' cannot be read: {type(error).__name__}: {error}")
        loss.__cause__ = error
        return loss

    def _tell(self, what: Callable[..., None], value: object) -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed, and nobody is left to tell
            self._loop.call_soon_threadsafe(what, value)

    def _begin(self, warnings: Sequence[str]) -> None:
        self.warnings = warnings

    def _deliver(self, picture: Picture) -> None:
        began = self._to_rig(picture.began)
        self.newest = Frame(picture.image, next(self._numbers), began, picture.exposure)
        self._wake()

    def _fail(self, error: Exception) -> None:
        self._error = error
        self._wake()

    def _wake(self) -> None:
        self._news.set_result(None)
        self._news = self._loop.create_future()
