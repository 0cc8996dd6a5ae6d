"""Emulated drives at the other end of a kernel's CAN interface, which may go and come."""

import contextlib
import socket
import threading

import can

_LOOK = 0.05
"""Seconds between two tries."""

_FOR_DRIVES = [
    {"can_id": 0x000, "can_mask": 0x7FF, "extended": False},  # commands to all
    {"can_id": 0x080, "can_mask": 0x7FF, "extended": False},  # SYNC
    *({"can_id": node, "can_mask": 0x07F, "extended": False} for node in (1, 2, 127)),
]
"""What a drive's own CAN controller lets through to it."""


class Cable:
    """Carries frames between a virtual bus and an interface, for as long as there is one."""

    def __init__(self, interface: str, virtual: str) -> None:
        self._interface = interface
        self._drives = can.Bus(interface="virtual", channel=virtual)
        self._computer: can.BusABC | None = None
        self._ending = threading.Event()
        self._threads = [threading.Thread(target=work) for work in (self._to_computer, self._to_drives)]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        self._ending.set()
        for thread in self._threads:
            thread.join()
        self._drives.shutdown()

    def _to_computer(self) -> None:
        while not self._ending.is_set():
            message, bus = self._drives.recv(_LOOK), self._computer
            if message is not None and bus is not None:
                with contextlib.suppress(can.CanError, OSError, ValueError):
                    bus.send(message)

    def _to_drives(self) -> None:
        while not self._ending.is_set():
            try:
                socket.if_nametoindex(self._interface)  # python-can leaks a socket where there is none
                with can.Bus(interface="socketcan", channel=self._interface, can_filters=_FOR_DRIVES) as bus:
                    bus.socket.setblocking(False)  # an error that wakes it may be taken by who sends
                    self._computer = bus
                    while not self._ending.is_set():
                        message = bus.recv(_LOOK)
                        if message is not None:
                            self._drives.send(message)
            except (can.CanError, OSError):
                self._ending.wait(_LOOK)
            finally:
                self._computer = None
