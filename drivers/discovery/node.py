"""What there is to say of any device node."""

import grp
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from drivers.discovery.machine import Machine, text_of


@dataclass(frozen=True, slots=True)
class UsbIdentity:
    """How a device on USB introduces itself."""

    vendor_id: str
    product_id: str
    manufacturer: str | None
    product: str | None
    serial: str | None


@dataclass(frozen=True, slots=True)
class Holder:
    """A process that has a node open."""

    pid: int
    name: str


@dataclass(frozen=True, slots=True)
class Node:
    """A device node such as /dev/ttyUSB0."""

    path: str
    names: tuple[str, ...]
    """Its links below by-id and by-path, which stay the same when its number does not."""
    driver: str | None
    usb: UsbIdentity | None
    may_open: bool
    """Whether the user may read and write it."""
    group: str
    """The group that may."""
    holders: tuple[Holder, ...]
    """Who has it open, as far as the user may see."""


def describe(machine: Machine, path: Path, device: Path, links: str) -> Node:
    """Return what there is to say of the node at `path`, whose device is the /sys folder `device`.

    `links` is the folder of its names: "serial" or "v4l".
    """
    status = path.stat()
    driver = device / "driver"
    return Node(
        path=machine.name(path),
        names=tuple(_names(machine, path, links)),
        driver=driver.resolve().name if driver.exists() else None,
        usb=_usb(machine, device),
        may_open=_may_open(machine, status.st_mode, status.st_uid, status.st_gid),
        group=_group(status.st_gid),
        holders=tuple(_holders(machine, path)),
    )


def _names(machine: Machine, path: Path, links: str) -> Iterator[str]:
    for kind in ("by-id", "by-path"):
        for link in machine.entries(f"dev/{links}/{kind}"):
            if link.resolve() == path.resolve():
                yield machine.name(link)


def _usb(machine: Machine, device: Path) -> UsbIdentity | None:
    here = device.resolve()
    while here not in (machine.root, here.parent):
        vendor, product = text_of(here / "idVendor"), text_of(here / "idProduct")
        if vendor is not None and product is not None:
            words = (text_of(here / name) for name in ("manufacturer", "product", "serial"))
            return UsbIdentity(vendor, product, *words)
        here = here.parent
    return None


def _may_open(machine: Machine, mode: int, owner: int, group: int) -> bool:
    if machine.uid == 0:
        return True
    if machine.uid == owner:
        needed = stat.S_IRUSR | stat.S_IWUSR
    elif group in machine.groups:
        needed = stat.S_IRGRP | stat.S_IWGRP
    else:
        needed = stat.S_IROTH | stat.S_IWOTH
    return mode & needed == needed


def _group(number: int) -> str:
    try:
        return grp.getgrgid(number).gr_name
    except KeyError:
        return str(number)


def _holders(machine: Machine, path: Path) -> Iterator[Holder]:
    for process in machine.entries("proc"):
        if process.name.isdigit() and _holds(process, path):
            yield Holder(int(process.name), text_of(process / "comm") or "?")


def _holds(process: Path, path: Path) -> bool:
    try:
        return any(handle.resolve() == path.resolve() for handle in (process / "fd").iterdir())
    except OSError:
        return False  # it has ended, or is somebody else's
