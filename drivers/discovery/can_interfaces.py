"""The CAN interfaces that there are."""

from dataclasses import dataclass
from typing import Final

from drivers.discovery.machine import Machine, text_of

_CAN: Final = "280"
"""ARPHRD_CAN."""
_UP: Final = 0x1
"""IFF_UP."""


@dataclass(frozen=True, slots=True)
class CanInterface:
    """A network interface that is a CAN bus."""

    name: str
    up: bool
    driver: str | None
    """None of a virtual one."""


def can_interfaces(machine: Machine) -> list[CanInterface]:
    """Return every CAN interface, in the order of their names."""
    found = []
    for interface in machine.entries("sys/class/net"):
        if text_of(interface / "type") == _CAN:
            flags = int(text_of(interface / "flags") or "0", 16)
            driver = interface / "device/driver"
            name = driver.resolve().name if driver.exists() else None
            found.append(CanInterface(interface.name, bool(flags & _UP), name))
    return found
