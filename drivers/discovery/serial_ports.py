"""The serial ports that there are."""

from drivers.discovery.machine import Machine, text_of
from drivers.discovery.node import Node, describe

_ABSENT = "0"
"""The type of a port that a mainboard could have and has not."""


def serial_ports(machine: Machine) -> list[Node]:
    """Return every serial port with a device behind it, in the order of their names."""
    ports = []
    for port in machine.entries("sys/class/tty"):
        path = machine.path(f"/dev/{port.name}")
        if (port / "device").exists() and text_of(port / "type") != _ABSENT and path.exists():
            ports.append(describe(machine, path, port / "device", "serial"))
    return ports
