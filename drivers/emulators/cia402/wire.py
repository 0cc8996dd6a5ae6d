"""What an emulated bus's frames travel by: a python-can bus, or a USB adapter that speaks `slcan`."""

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, Final

import can

from drivers.emulators.pty_port import PtyPort

Receive = Callable[[int, bytes], None]

_BUS_OFF: Final = 0x40
"""The identifier of the error frame in which Linux says that a controller went off the bus."""


class Wire(ABC):
    """Carries frames between the drives and whoever is at its other end, from `open` to `close`."""

    @abstractmethod
    def open(self, receive: Receive) -> Mapping[str, object]:
        """Begin to carry. Return the keys of the driver's options by which it is reached."""

    @abstractmethod
    def send(self, can_id: int, data: bytes) -> None:
        """Put a frame of the drives on the bus."""

    def send_bus_off(self) -> None:  # noqa: B027  an adapter has no frame to say it with
        """Say that the other end's controller has gone off the bus."""

    def unplug(self) -> None:  # noqa: B027  a bus stays where it is
        """Be gone from the computer, where there is something that can be."""

    def plug(self) -> None:  # noqa: B027
        """Be there again."""

    @abstractmethod
    def close(self) -> None:
        """Carry nothing any longer."""


class BusWire(Wire):
    """A bus of python-can, between threads or between processes."""

    def __init__(self, interface: str, channel: str, **arguments: object) -> None:
        self._arguments: dict[str, Any] = {"interface": interface, "channel": channel, **arguments}
        self._bus: can.BusABC | None = None
        self._notifier: can.Notifier | None = None

    def open(self, receive: Receive) -> Mapping[str, object]:
        """Join the bus."""
        arguments = dict(self._arguments)
        if arguments["interface"] == "udp_multicast":
            arguments["hop_limit"] = 0  # nobody on the network is to hear of it
        bus = can.Bus(**arguments)

        def hear(message: can.Message) -> None:
            if not (message.is_error_frame or message.is_remote_frame):
                receive(message.arbitration_id, bytes(message.data))

        self._bus = bus
        self._notifier = can.Notifier(bus, [hear], timeout=0.05, loop=asyncio.get_running_loop())
        return self._arguments

    def send(self, can_id: int, data: bytes) -> None:
        """Put a frame on the bus."""
        self._put(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    def send_bus_off(self) -> None:
        """Send the error frame that a Linux driver makes of it."""
        self._put(can.Message(arbitration_id=_BUS_OFF, is_error_frame=True, data=bytes(8)))

    def close(self) -> None:
        """Leave the bus."""
        if self._notifier is not None:
            self._notifier.stop()
        if self._bus is not None:
            self._bus.shutdown()
        self._bus = self._notifier = None

    def _put(self, message: can.Message) -> None:
        if self._bus is not None:
            self._bus.send(message)


class AdapterWire(Wire):
    """A serial CAN adapter: Lawicel's `slcan` on a pseudo-terminal, under a name that stays."""

    def __init__(self) -> None:
        self._port = PtyPort("can-adapter", self._hear, self._reset)
        self._receive: Receive = lambda _id, _data: None
        self._line = bytearray()
        self._on_the_bus = False

    def open(self, receive: Receive) -> Mapping[str, object]:
        """Be plugged in."""
        self._receive = receive
        self.plug()
        return {"interface": "slcan", "channel": str(self._port.path), "adapter_delay": "10 ms"}

    def plug(self) -> None:
        """Be there, mostly as another device, and always under the same name."""
        self._port.plug()

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame up to the computer."""
        if self._on_the_bus:
            self._port.send(f"t{can_id:03X}{len(data)}{data.hex().upper()}\r".encode())

    def unplug(self) -> None:
        """Be gone from the computer, the name as well."""
        self._port.unplug()

    def close(self) -> None:
        """Be gone for good."""
        self._port.close()

    def _reset(self) -> None:
        self._line.clear()
        self._on_the_bus = False

    def _hear(self, data: bytes) -> None:
        self._line += data
        while (end := self._line.find(b"\r")) >= 0:
            line = bytes(self._line[:end])
            del self._line[: end + 1]
            self._port.send(self._obey(line.decode("ascii", "replace")))

    def _obey(self, line: str) -> bytes:
        match line[:1]:
            case "O" | "L":
                self._on_the_bus = True
            case "C":
                self._on_the_bus = False
            case "S" | "":
                pass
            case "t" if self._on_the_bus:
                length = int(line[4])
                self._receive(int(line[1:4], 16), bytes.fromhex(line[5 : 5 + 2 * length]))
                return b"z\r"
            case _:
                return b"\a"
        return b"\r"
