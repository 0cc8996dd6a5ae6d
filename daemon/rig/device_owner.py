"""The task that owns a device: it connects, notices a loss, states it, and connects again."""

import asyncio
import logging
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Final, Literal

from daemon.rig.snapshot import DeviceSnapshot
from daemon.rig.wording import because
from drivers.cancellation import finish
from drivers.driver import Cautious
from drivers.errors import DriverError

logger = logging.getLogger(__name__)

FIRST_DELAY: Final = 0.2
LONGEST_DELAY: Final = 5.0
"""Seconds of life between two attempts to connect: the first, doubled until the longest."""


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
        self._hardware = hardware
        self._publish = publish

    @property
    def device(self) -> DeviceSnapshot:
        """What there is to say of the device as a whole."""
        return DeviceSnapshot(self.name, self.kind, self.lost, self.reconnects, self.warnings)

    async def run(self) -> None:
        """Keep the device connected until cancelled; then close it, which stops what moves."""
        delay = FIRST_DELAY
        connected_before = False
        while True:
            try:
                await self._open()
                self.lost = None
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

    async def _close_quietly(self) -> None:
        try:
            await self._close()
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
