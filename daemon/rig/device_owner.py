"""The task that owns a device: it connects, notices a loss, states it, and connects again."""

import asyncio
import contextlib
import logging
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from typing import Final, Literal

from daemon.rig.snapshot import DeviceSnapshot
from daemon.rig.wording import because
from drivers.cancellation import finish
from drivers.driver import Cautious
from drivers.errors import DeviceTimeoutError, DriverError

logger = logging.getLogger(__name__)

FIRST_DELAY: Final = 0.2
LONGEST_DELAY: Final = 5.0
"""Seconds of life between two attempts to connect: the first, doubled until the longest."""
LONGEST_WORK: Final = 30.0
"""Seconds that a driver may take to open, to close or to read a device before it counts as hung."""


class DeviceOwner(ABC):
    """One device, from `run` until its cancellation. A subclass says how it is opened, served and closed."""

    def __init__(
        self, name: str, kind: Literal["controller", "camera"], hardware: object, publish: Callable[[], None]
    ) -> None:
        self.name = name
        self.kind: Literal["controller", "camera"] = kind
        self.warnings: tuple[str, ...] = ()
        """What the driver had to say of the device when it was opened."""
        self.lost: str | None = f"{kind} '{name}' is not connected yet"
        self.reconnects = 0
        self.attempted = asyncio.Event()
        """Set once the first attempt to connect has ended, one way or the other."""
        self._working_since: float | None = None
        self._held: str | None = None
        """Why the device could not be let go, though it should have been."""
        self._hardware = hardware
        self._publish = publish

    @property
    def device(self) -> DeviceSnapshot:
        """What there is to say of the device as a whole."""
        return DeviceSnapshot(self.name, self.kind, self.lost, self.reconnects, self.warnings)

    @property
    def hung(self) -> str | None:
        """A sentence where the driver does not come back from what it was asked to do: only a restart helps."""
        since = self._working_since
        if since is None or time.monotonic() - since < LONGEST_WORK:
            return self._held
        return f"the driver of {self.kind} '{self.name}' has hung for {time.monotonic() - since:.0f} s"

    async def run(self) -> None:
        """Keep the device connected until cancelled; then close it, which stops what moves."""
        delay = FIRST_DELAY
        connected_before = False
        while True:
            try:
                with self._at_work():
                    await self._open()
                self.lost = self._held = None
                self.reconnects += connected_before
                connected_before, delay = True, FIRST_DELAY
                logger.info("%s '%s' is connected", self.kind, self.name)
                self._note_warnings()
                self.attempted.set()
                await self._serve()
            except Exception as error:  # whatever a driver raises, its owner must go on
                self._lose(error)
            finally:
                self.attempted.set()
                with self._at_work():
                    await finish(self._close_quietly())
            await asyncio.sleep(delay)
            delay = min(2 * delay, LONGEST_DELAY)

    def _note_warnings(self) -> None:
        warnings = tuple(self._hardware.warnings) if isinstance(self._hardware, Cautious) else ()
        for sentence in warnings:
            if sentence not in self.warnings:
                logger.warning(sentence)
        self.warnings = warnings

    def _lose(self, error: Exception) -> None:
        expected = isinstance(error, DriverError | OSError)
        sentence = str(error) if expected else f"{type(error).__name__} in the driver: {error}"
        sentence = because(f"{self.kind} '{self.name}'", "is lost", sentence)
        if sentence != self.lost:
            logger.warning(sentence, exc_info=None if expected else error)
        self.lost = sentence
        self._on_loss()
        self._publish()

    @contextlib.contextmanager
    def _at_work(self) -> Generator[None]:
        """Expect the driver to be done with what is asked of it in this block."""
        self._working_since = time.monotonic()
        try:
            yield
        finally:
            self._working_since = None

    async def _close_quietly(self) -> None:
        try:
            await self._close()
        except DeviceTimeoutError as error:
            self._held = str(error)
            logger.warning("%s '%s' is not let go: %s", self.kind, self.name, error)
        except Exception as error:  # a lost device may fail in any way when it is let go
            logger.warning("%s '%s' did not close cleanly: %s", self.kind, self.name, error)

    @abstractmethod
    async def _open(self) -> None:
        """Connect."""

    @abstractmethod
    async def _serve(self) -> None:
        """Work with the device until it is lost, which raises."""

    @abstractmethod
    async def _close(self) -> None:
        """Stop what moves and let the device go."""

    def _on_loss(self) -> None:  # noqa: B027  a device without state of its own has nothing to do
        """Forget what a lost device cannot be believed any longer."""
