"""A device node of the kernel's Video4Linux: whose it is, and its controls by the names that v4l2-ctl shows.

Four ioctls of <linux/videodev2.h>, whose numbers and structures never change: OpenCV names only some controls,
and clamps what it is given without a word.
"""

import errno
import fcntl
import os
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final, Protocol

from drivers.errors import DeviceLostError, OptionsError

QUERYCAP: Final = 0x80685600
QUERYCTRL: Final = 0xC0445624
GET_CONTROL: Final = 0xC008561B
SET_CONTROL: Final = 0xC008561C

_QUERY: Final = struct.Struct("=2I32s4iI2I")
_CONTROL: Final = struct.Struct("=Ii")
_CAPABILITIES: Final = struct.Struct("=16s32s32s3I3I")
_CAPTURES: Final = 0x1
_NEXT: Final = 0x80000000
_SETTABLE: Final = (1, 2, 3, 8, 9)
"""Types: integer, boolean, menu, bitmask, menu of integers. The others are strings, buttons and headings."""
_UNUSABLE: Final = 0x1 | 0x4 | 0x40
"""Flags: disabled, read-only, write-only."""


@dataclass(frozen=True, slots=True)
class Control:
    """A number that a camera lets be set."""

    id: int
    name: str
    minimum: int
    maximum: int
    step: int


class Node(Protocol):
    """What is asked of a device node beside its pictures."""

    @property
    def controls(self) -> Mapping[str, Control]:
        """What can be set, by name."""
        ...

    def get(self, control: Control) -> int:
        """Return a control's present value. Raises OSError."""
        ...

    def set(self, control: Control, value: int) -> None:
        """Ask for a value. Raises OSError; that it does not, does not mean that it was obeyed."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class DeviceNode:
    """A node that is open, and locked against a second program that asks for the lock as this one does."""

    def __init__(self, camera: str, device: str) -> None:
        """Open `device` for `camera`. Raises DeviceLostError, and OptionsError for a node without pictures."""
        self._fd = _opened(camera, device)
        try:
            _lock(self._fd, camera, device)
            _require_pictures(self._fd, camera, device)
        except BaseException:
            self.close()
            raise

    @cached_property
    def controls(self) -> Mapping[str, Control]:
        """What can be set, by name."""
        found: dict[str, Control] = {}
        last = 0
        while True:
            query = bytearray(_QUERY.size)
            struct.pack_into("=I", query, 0, last | _NEXT)
            try:
                fcntl.ioctl(self._fd, QUERYCTRL, query)
            except OSError as error:
                if error.errno in (errno.EINVAL, errno.ENOTTY):
                    return found  # there are no more
                raise
            last, kind, label, low, high, step, _, flags, *_ = _QUERY.unpack(query)
            if kind in _SETTABLE and not flags & _UNUSABLE:
                name = control_name(label.split(b"\0")[0].decode("ascii", "replace"))
                found[name] = Control(last, name, low, high, step)

    def get(self, control: Control) -> int:
        """Return a control's present value. Raises OSError."""
        asked = bytearray(_CONTROL.pack(control.id, 0))
        fcntl.ioctl(self._fd, GET_CONTROL, asked)
        value: int = _CONTROL.unpack(asked)[1]
        return value

    def set(self, control: Control, value: int) -> None:
        """Ask for a value. Raises OSError; that it does not, does not mean that it was obeyed."""
        fcntl.ioctl(self._fd, SET_CONTROL, bytearray(_CONTROL.pack(control.id, value)))

    def close(self) -> None:
        """Let go of it, and of the lock."""
        os.close(self._fd)


def control_name(label: str) -> str:
    """Return the name that v4l2-ctl makes of a control's label: `exposure_time_absolute`."""
    return re.sub(r"[^a-z0-9]+", "_", label.lower()).strip("_")


def _opened(camera: str, device: str) -> int:
    try:
        return os.open(device, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError as error:
        raise DeviceLostError(f"camera '{camera}': {device} is not there: plug it in{_others()}") from error
    except PermissionError as error:
        raise DeviceLostError(
            f"camera '{camera}': {device} may not be opened by this user: "
            "add the user to the group 'video', and log in again"
        ) from error
    except OSError as error:
        raise DeviceLostError(f"camera '{camera}': {device} cannot be opened: {error.strerror}") from error


def _others() -> str:
    """Name the cameras that are there, for who has mistyped one."""
    found = sorted(str(path) for path in Path("/dev/v4l/by-id").glob("*"))
    return f", or choose another one of {', '.join(found)}" if found else ""


def _lock(fd: int, camera: str, device: str) -> None:
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise DeviceLostError(
            f"camera '{camera}': {device} is held by another activecam: end that one first"
        ) from error


def _require_pictures(fd: int, camera: str, device: str) -> None:
    answer = bytearray(_CAPABILITIES.size)
    try:
        fcntl.ioctl(fd, QUERYCAP, answer)
        capabilities = _CAPABILITIES.unpack(answer)[5]
    except OSError:
        capabilities = 0
    if not capabilities & _CAPTURES:
        raise OptionsError(
            f"camera '{camera}': {device} delivers no pictures: a camera has several nodes, "
            "of which the one that ends in index0 does"
        )
