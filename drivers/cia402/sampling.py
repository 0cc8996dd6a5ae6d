"""Where all drives of a bus are at one instant: they answer a SYNC frame with their PDOs."""

import asyncio
import struct
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Final

from drivers.cia402.link import Link, Network
from drivers.cia402.statusword import State, state_of
from drivers.clock import Clock
from drivers.errors import DeviceLostError

SYNC: Final = 0x080
STATE_AND_POSITION: Final = struct.Struct("<Hi")
"""Statusword and actual position: what the first PDO carries."""
SPEED: Final = struct.Struct("<i")
"""Actual velocity: what the second one carries."""


@dataclass(frozen=True, slots=True)
class Sample:
    """What a drive said of one instant, in its own units."""

    timestamp: float
    """Of the rig's clock (s): the drive was asked then, and answered of that time or a moment later."""
    statusword: int
    position: int
    velocity: int

    @property
    def state(self) -> State:
        """The state that the drive was in."""
        return state_of(self.statusword)

    def has(self, bit: int) -> bool:
        """Return whether this bit of the statusword is set."""
        return bool(self.statusword & bit)


class Sampler:
    """Asks all drives of a bus at once. Calls that come while an answer is awaited share the next one.

    A drive whose PDOs do not come is asked by SDO: frames get lost where a computer is too slow to read them. Its
    answer comes after all that it sent before, so that no PDO is taken for one of a later SYNC.
    """

    def __init__(self, link: Link, clock: Clock, patience: float) -> None:
        """`patience` (s): how long the PDOs of a SYNC may take."""
        self._link = link
        self._clock = clock
        self._patience = patience
        self._ask_singly: dict[int, Callable[[], Awaitable[Sample | None]]] = {}
        self._heard: dict[int, dict[int, bytes]] = {}
        self._complete: asyncio.Event | None = None
        self._one_at_a_time = asyncio.Lock()
        self._next: asyncio.Task[Mapping[int, Sample]] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None

    def open(self, drives: Mapping[int, Callable[[], Awaitable[Sample | None]]]) -> None:
        """Begin to listen to these nodes; each comes with how to ask it alone, None where it is lost."""
        self._loop = asyncio.get_running_loop()
        self._ask_singly = dict(drives)

    async def close(self) -> None:
        """Give up what is awaited."""
        if self._next is not None:
            self._next.cancel()
            await asyncio.wait([self._next])
            self._next = None

    def hear(self, node: int, pdo: int, data: bytes) -> None:
        """Take in a PDO, in whatever thread."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._take_in, node, pdo, data)

    async def sample(self, node: int) -> Sample | None:
        """Return what `node` says of an instant after this call; None where it is lost.

        Raises DeviceLostError where the bus is, and where it is let go meanwhile.
        """
        if self._next is None:
            self._next = asyncio.create_task(self._take())
            self._next.add_done_callback(_retrieve)
        sampling = self._next
        # Not awaited itself: that it is given up would look as if whoever waits for it was cancelled.
        await asyncio.wait([sampling])
        if sampling.cancelled():
            raise DeviceLostError(f"{self._link.name} was closed: open it first")
        return sampling.result().get(node)

    async def _take(self) -> Mapping[int, Sample]:
        async with self._one_at_a_time:
            self._next = None
            self._heard = {node: {} for node in self._ask_singly}
            self._complete = asyncio.Event()
            asked_at = self._clock.now()
            await self._link.ask(_send_sync)
            try:
                async with asyncio.timeout(self._patience):
                    await self._complete.wait()
            except TimeoutError:
                pass
            samples = {}
            for node, parts in self._heard.items():
                sample = _combine(asked_at, parts) or await self._ask_singly[node]()
                if sample is not None:
                    samples[node] = sample
            return samples

    def _take_in(self, node: int, pdo: int, data: bytes) -> None:
        if node in self._heard and self._complete is not None:
            self._heard[node][pdo] = data
            if all(len(parts) == 2 for parts in self._heard.values()):
                self._complete.set()


def _send_sync(network: Network) -> None:
    network.send_message(SYNC, b"")


def _combine(asked_at: float, parts: Mapping[int, bytes]) -> Sample | None:
    if len(parts.get(1, b"")) != STATE_AND_POSITION.size or len(parts.get(2, b"")) != SPEED.size:
        return None
    return Sample(asked_at, *STATE_AND_POSITION.unpack(parts[1]), *SPEED.unpack(parts[2]))


def _retrieve(task: "asyncio.Task[Mapping[int, Sample]]") -> None:
    if not task.cancelled():
        task.exception()  # asked for, so that asyncio does not report it where every caller was cancelled
