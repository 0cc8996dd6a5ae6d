"""What is there, what is wrong with it, and what to do."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from daemon.doctor.expected import Expected, expected
from daemon.profile import Profile
from drivers.discovery.cameras import Camera, cameras
from drivers.discovery.can_interfaces import CanInterface, can_interfaces
from drivers.discovery.machine import Machine
from drivers.discovery.node import Node
from drivers.discovery.serial_ports import serial_ports


@dataclass(frozen=True, slots=True)
class Problem:
    """Something that keeps a device from being used."""

    device: str
    problem: str
    remedy: str


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """All devices, and everything that is wrong with them."""

    serial_ports: Sequence[Node]
    can_interfaces: Sequence[CanInterface]
    cameras: Sequence[Camera]
    expected: Sequence[Expected]
    problems: Sequence[Problem]


def examine(machine: Machine, profile: Profile | None = None) -> Diagnosis:
    """Look at all devices of a machine, or, of what is wrong, only at what concerns those of `profile`."""
    ports, buses, eyes = serial_ports(machine), can_interfaces(machine), cameras(machine)
    nodes = [*ports, *(camera.node for camera in eyes)]
    if profile is None:
        problems = [*_all_closed(nodes), *_all_down(buses)]
        return Diagnosis(ports, buses, eyes, [], problems)
    wanted = expected(profile)
    problems = [problem for want in wanted for problem in _of(want, machine, nodes, buses)]
    return Diagnosis(ports, buses, eyes, wanted, problems)


def _all_closed(nodes: Sequence[Node]) -> Iterator[Problem]:
    for node in nodes:
        if not node.may_open:
            yield _closed(node.path, node)


def _all_down(buses: Sequence[CanInterface]) -> Iterator[Problem]:
    for bus in buses:
        if not bus.up:
            yield _down(bus.name, bus)


def _of(
    want: Expected, machine: Machine, nodes: Sequence[Node], buses: Sequence[CanInterface]
) -> Iterator[Problem]:
    if want.kind == "CAN interface":
        bus = next((bus for bus in buses if bus.name == want.address), None)
        if bus is None:
            yield _missing(want, [bus.name for bus in buses])
        elif not bus.up:
            yield _down(want.device, bus)
        return
    path = machine.path(want.address)
    node = next((node for node in nodes if machine.path(node.path).resolve() == path.resolve()), None)
    if node is None:
        if path.exists():
            yield Problem(
                want.device,
                f"{want.address} is no {want.kind}",
                "name one of those that are listed"
                if nodes
                else "plug it in, and name it as it is listed then",
            )
        else:
            yield _missing(want, [name for node in nodes for name in node.names if _alike(name, want)])
        return
    if not node.may_open:
        yield _closed(want.device, node)
    for holder in node.holders:
        yield Problem(
            want.device,
            f"{node.path} is held by '{holder.name}' (process {holder.pid})",
            "end it, unless it is the daemon that serves this profile",
        )


def _alike(name: str, want: Expected) -> bool:
    """Return whether a lasting name is one of the kind of device that is wanted."""
    return name.startswith("/dev/v4l/" if want.kind == "camera" else "/dev/serial/") and "/by-id/" in name


def _missing(want: Expected, there: Sequence[str]) -> Problem:
    others = f", or name one of {', '.join(there)} in the profile" if there else ""
    return Problem(want.device, f"{want.kind} {want.address} is not there", f"plug it in{others}")


def _closed(device: str, node: Node) -> Problem:
    return Problem(
        device,
        f"{node.path} may not be opened by this user",
        f"sudo usermod -aG {node.group} $USER, then log in again",
    )


def _down(device: str, bus: CanInterface) -> Problem:
    bit_rate = "" if bus.driver is None else " type can bitrate 500000   (or the bit rate of your bus)"
    return Problem(device, f"CAN interface {bus.name} is down", f"sudo ip link set {bus.name} up{bit_rate}")
