"""The V4L2 cameras that there are, and what formats they offer."""

import fcntl
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from drivers.discovery.machine import Machine, text_of
from drivers.discovery.node import Node, describe

_ENUM_FORMATS: Final = 0xC0405602
_ENUM_SIZES: Final = 0xC02C564A
_FORMAT: Final = struct.Struct("=3I32sI4I")
_SIZE: Final = struct.Struct("=3I6I2I")
_CAPTURE: Final = 1
_DISCRETE: Final = 1


@dataclass(frozen=True, slots=True)
class Format:
    """A way in which pictures come."""

    name: str
    """Its four characters."""
    sizes: tuple[tuple[int, int], ...]
    """Width and height; the smallest and the largest where all between them can be had."""


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera's node that gives pictures."""

    label: str
    node: Node
    formats: tuple[Format, ...]
    """Empty where they cannot be asked for."""


def cameras(machine: Machine) -> list[Camera]:
    """Return every camera, in the order of their nodes' names."""
    found = []
    for video in machine.entries("sys/class/video4linux"):
        path = machine.path(f"/dev/{video.name}")
        # The further nodes of a camera give descriptions, not pictures.
        if video.name.startswith("video") and text_of(video / "index") == "0" and path.exists():
            node = describe(machine, path, video / "device", "v4l")
            found.append(Camera(text_of(video / "name") or video.name, node, tuple(_formats(path, node))))
    return found


def _formats(path: Path, node: Node) -> list[Format]:
    if not node.may_open:
        return []
    try:
        fd = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return []
    try:
        return [Format(name, tuple(_sizes(fd, code))) for name, code in _codes(fd)]
    finally:
        os.close(fd)


def _codes(fd: int) -> Iterator[tuple[str, int]]:
    index = 0
    while (answer := _ask(fd, _ENUM_FORMATS, _FORMAT, index, _CAPTURE)) is not None:
        code = answer[4]
        yield code.to_bytes(4, "little").decode("ascii", "replace").strip(), code
        index += 1


def _sizes(fd: int, code: int) -> Iterator[tuple[int, int]]:
    index = 0
    while (answer := _ask(fd, _ENUM_SIZES, _SIZE, index, code)) is not None:
        kind, width, height_or_widest, _, lowest, highest = answer[2:8]
        if kind != _DISCRETE:
            yield width, lowest
            yield height_or_widest, highest
            return
        yield width, height_or_widest
        index += 1


def _ask(fd: int, request: int, layout: struct.Struct, *arguments: int) -> tuple[Any, ...] | None:
    """Return the kernel's answer to a question whose first numbers are `arguments`, None after the last."""
    answer = bytearray(layout.size)
    struct.pack_into(f"={len(arguments)}I", answer, 0, *arguments)
    try:
        fcntl.ioctl(fd, request, answer)
    except OSError:
        return None
    return layout.unpack(answer)
