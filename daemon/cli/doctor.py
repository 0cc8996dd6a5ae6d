"""`activecam doctor`: what devices there are, and what keeps a rig from using them."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Annotated

import typer

from daemon.cli.console import output
from daemon.doctor import Diagnosis, examine
from daemon.profile import load_profile
from drivers.discovery.cameras import Camera, Format
from drivers.discovery.can_interfaces import CanInterface
from drivers.discovery.machine import Machine
from drivers.discovery.node import Node


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog="Example: activecam doctor my-rig.toml")(doctor)


def doctor(
    profile: Annotated[
        str | None,
        typer.Argument(help="The rig's profile, to look for its devices: a file, or a shipped one's name."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print everything as JSON.")] = False,
) -> int:
    """List serial ports, CAN interfaces and cameras, and say what keeps them from being used, and what to do."""
    diagnosis = examine(Machine(), None if profile is None else load_profile(profile))
    if as_json:
        typer.echo(json.dumps(asdict(diagnosis)))
    else:
        for line in in_words(diagnosis):
            output.print(line, markup=False, soft_wrap=True)
    return 1 if diagnosis.problems else 0


def in_words(diagnosis: Diagnosis) -> Iterator[str]:
    """Yield the lines that a person reads."""
    yield from _section("Serial ports", [_port(port) for port in diagnosis.serial_ports])
    yield from _section("CAN interfaces", [_bus(bus) for bus in diagnosis.can_interfaces])
    yield from _section("Cameras", [_camera(camera) for camera in diagnosis.cameras])
    if diagnosis.expected:
        wanted = [f"{want.device}: {want.kind} {want.address}" for want in diagnosis.expected]
        yield from _section("The profile wants", [[line] for line in wanted])
    if not diagnosis.problems:
        yield "No problems were found."
    for problem in diagnosis.problems:
        yield f"{problem.device}: {problem.problem}"
        yield f"  {problem.remedy}"


def _section(title: str, entries: Sequence[Sequence[str]]) -> Iterator[str]:
    yield title if entries else f"{title}: none"
    for first, *rest in entries:
        yield f"  {first}"
        yield from (f"      {line}" for line in rest)


def _port(node: Node) -> list[str]:
    return [_headline(node, node.path), *node.names, *_held(node)]


def _bus(bus: CanInterface) -> list[str]:
    return [f"{bus.name} ({bus.driver or 'virtual'}), {'up' if bus.up else 'down'}"]


def _camera(camera: Camera) -> list[str]:
    node = camera.node
    formats = [_format(form) for form in camera.formats]
    return [_headline(node, f"{node.path} '{camera.label}'"), *node.names, *formats, *_held(node)]


def _headline(node: Node, name: str) -> str:
    words = [name]
    if node.usb is not None:
        usb = node.usb
        said = [word for word in (usb.manufacturer, usb.product, usb.serial) if word]
        words.append(f"USB {usb.vendor_id}:{usb.product_id} {' '.join(said)}".rstrip())
    if node.driver is not None:
        words.append(f"driver {node.driver}")
    return ", ".join(words)


def _format(form: Format) -> str:
    return f"{form.name}: {', '.join(f'{width} x {height}' for width, height in form.sizes)}"


def _held(node: Node) -> list[str]:
    return [f"held by '{holder.name}' (process {holder.pid})" for holder in node.holders]
