"""The CAN bus: opened, spoken to by one thread, and noticed when it is gone."""

import asyncio
import contextlib
import errno
import logging
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, TypeVar

import can
import canopen

from drivers.cancellation import finish
from drivers.cia402.options import Cia402Options
from drivers.errors import DeviceLostError, DriverError

Result = TypeVar("Result")

_PATIENCE: Final = 0.1
"""Seconds that a full transmit queue is given to drain."""
_MAY_HOLD_UP: Final = frozenset({"slcan"})
"""Interfaces that may keep who sends waiting: an adapter whose serial port takes nothing any more."""
_HEARTBEAT: Final = 0x700
_OPERATIONAL: Final = b"\x05"
_NODE: Final = 0x07F
"""The part of an identifier that tells the node."""
_BUS_OFF: Final = 0x40
"""Of an error frame's identifier (linux/can/error.h): the controller has left the bus."""

logger = logging.getLogger(__name__)
# It logs each of its steps; what goes wrong is said, with the drive's name, by this driver's errors.
logging.getLogger("canopen").setLevel(logging.CRITICAL)


class Link:
    """A bus that is open or lost. What blocks is done by `ask`, in one thread: SDOs of two would mix."""

    def __init__(self, options: Cia402Options, nodes: Iterable[int]) -> None:
        self.options = options
        self._nodes = tuple(nodes)
        self.name = f"the CAN bus '{options.channel}' ({options.interface})"
        self._network: Network | None = None
        self._asking: ThreadPoolExecutor | None = None
        self._stopping: ThreadPoolExecutor | None = None

    def require_open(self) -> "Network":
        """Return the network. Raises DeviceLostError where it is closed or lost."""
        network = self._network
        if network is None:
            raise DeviceLostError(f"{self.name} is not open: open it first")
        if network.loss is not None:
            raise DeviceLostError(f"{self.name} has gone: {network.loss}; check its interface and its cable")
        return network

    async def open(self) -> None:
        """Take the bus, and let go of it first where it was taken before. Raises DeviceLostError."""
        await self.close()
        self._asking = ThreadPoolExecutor(1, "cia402")
        self._stopping = ThreadPoolExecutor(1, "cia402-stop")
        network = Network(self.options.silence)
        try:
            await self._in_thread(
                self._asking, lambda: network.open(_bus_arguments(self.options, self._nodes))
            )
        except BaseException:
            self._network = network
            await self.close()
            raise
        self._network = network

    async def close(self) -> None:
        """Let the bus go, whatever state it is in."""
        network, self._network = self._network, None
        if network is not None and self._asking is not None:
            await self._in_thread(self._asking, network.close)
        for thread in (self._asking, self._stopping):
            if thread is not None:
                thread.shutdown()
        self._asking = self._stopping = None

    async def ask(self, question: Callable[["Network"], Result]) -> Result:
        """Return what `question` returns, asked in the bus's thread, behind what is asked there already.

        Raises DeviceLostError where the bus is lost, and what `question` raises.
        """
        network = self.require_open()
        assert self._asking is not None
        return await self._in_thread(self._asking, lambda: question(network))

    async def urge(self, send: Callable[["Network"], None]) -> None:
        """Have `send` called at once, past every question. It must not wait for an answer."""
        network = self.require_open()
        assert self._stopping is not None
        if self.options.interface in _MAY_HOLD_UP:
            await self._in_thread(self._stopping, lambda: send(network))
        else:
            # Not in another thread, whose turn is long in coming on a busy machine.
            with self._in_words():
                send(network)

    async def _in_thread(self, thread: ThreadPoolExecutor, work: Callable[[], Result]) -> Result:
        return await finish(self._translated(thread, work))

    async def _translated(self, thread: ThreadPoolExecutor, work: Callable[[], Result]) -> Result:
        with self._in_words():
            return await asyncio.get_running_loop().run_in_executor(thread, work)

    @contextlib.contextmanager
    def _in_words(self) -> Iterator[None]:
        """Raise DeviceLostError for what the CAN libraries raise."""
        try:
            yield
        except DriverError:
            raise  # some of them are OSErrors, too
        except (can.CanError, OSError) as error:
            raise DeviceLostError(f"{self.name}: {error}; check its interface and its cable") from error


class Network(canopen.Network):  # type: ignore[misc]
    """`canopen`'s network on a bus that may be full for a moment, or go away."""

    NOTIFIER_CYCLE = 0.1

    def __init__(self, silence: float) -> None:
        super().__init__()
        self.silence = silence
        self.loss: str | None = None
        """Why nothing is received any longer; None while it is."""
        self.listeners.append(_Watch(self))
        self._beating: threading.Thread | None = None
        self._closing = threading.Event()

    def open(self, arguments: dict[str, Any]) -> None:
        """Take the bus that `can.Bus` makes of `arguments`."""
        self.bus: Any = can.Bus(**arguments)
        received = getattr(self.bus, "socket", None)
        if received is not None:
            # An interface that goes wakes who receives and who sends, and the first to look takes the error:
            # the other one, told that there is something, would wait for it for ever.
            received.setblocking(False)
        self.connect()

    def close(self) -> None:
        """Let the bus go, whatever state it is in."""
        self._closing.set()
        if self._beating is not None:
            self._beating.join()
        bus = self.bus
        try:
            self.disconnect()
        except (can.CanError, OSError) as error:
            logger.info("the bus did not close cleanly: %s", error)
        # An adapter that was unplugged cannot be told to close, and keeps its port: it would come back elsewhere.
        port = getattr(bus, "serialPortOrig", None)
        if port is not None:
            port.close()
        self.bus = None

    def beat(self, node: int, period: float) -> None:
        """Say every `period` (s) that `node` is there, until `close`, however busy the program is."""
        self._beating = threading.Thread(target=self._beat, args=(node, period), name="cia402-heartbeat")
        self._beating.start()

    def _beat(self, node: int, period: float) -> None:
        with contextlib.suppress(can.CanError, OSError):  # whoever asks next finds out why
            while not self._closing.wait(period):
                self.send_message(_HEARTBEAT + node, _OPERATIONAL)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame; where the transmit queue is full, as soon as there is room."""
        until = time.monotonic() + _PATIENCE
        while True:
            try:
                super().send_message(can_id, data, remote)
            except can.CanOperationError as error:
                if error.error_code != errno.ENOBUFS or time.monotonic() >= until:
                    raise
                time.sleep(0.001)
            else:
                return

    def lose(self, why: str) -> None:
        """Remember why the bus is of no more use."""
        self.loss = self.loss or why


class _Watch(can.Listener):
    """Hears what `canopen` does not tell of: error frames, and the end of reception."""

    def __init__(self, network: Network) -> None:
        self._network = network

    def on_message_received(self, msg: can.Message) -> None:
        if msg.is_error_frame and msg.arbitration_id & _BUS_OFF:
            self._network.lose("its controller went off the bus after too many errors")

    def on_error(self, exc: Exception) -> None:
        if getattr(exc, "error_code", None) != errno.EAGAIN:  # which says that somebody else was told
            self._network.lose(str(exc))
        time.sleep(_PATIENCE)  # the thread that receives tries again and again until it is closed

    def stop(self) -> None:
        pass


def _bus_arguments(options: Cia402Options, nodes: Iterable[int]) -> dict[str, Any]:
    """Return what `can.Bus` is called with. Raises OSError where there is no such interface."""
    arguments: dict[str, Any] = {"interface": options.interface, "channel": options.channel}
    match options.interface:
        case "socketcan":
            socket.if_nametoindex(options.channel)  # python-can leaks a socket where there is none
            # What others say on the bus is kept out of the queue, which a slow reader would let overflow.
            arguments["can_filters"] = [
                {"can_id": node, "can_mask": _NODE, "extended": False} for node in nodes
            ]
        case "slcan":
            arguments |= {"bitrate": options.bitrate, "sleep_after_open": options.adapter_delay}
        case "udp_multicast":
            arguments |= {"hop_limit": 0} | ({} if options.port is None else {"port": options.port})
    return arguments
