"""A machine's /dev, /proc and /sys as files in a folder."""

import os
from pathlib import Path

from drivers.discovery.machine import Machine


class Tree:
    """Grows devices below `root`, seen by a user who is not root."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.machine = Machine(root, uid=os.getuid() + 1000, groups=frozenset([os.getgid()]))

    def write(self, path: str, text: str = "") -> Path:
        file = self.root / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        return file

    def link(self, path: str, target: Path) -> None:
        link = self.root / path
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(target)

    def usb(self, bus: str, driver: str) -> Path:
        """Return the folder of an interface of a USB device."""
        device = f"sys/devices/usb1/{bus}"
        for name, text in {
            "idVendor": "1a86",
            "idProduct": "7523",
            "manufacturer": "Acme",
            "product": "Board",
        }.items():
            self.write(f"{device}/{name}", f"{text}\n")
        interface = self.root / device / f"{bus}:1.0"
        interface.mkdir()
        self.driver(interface, driver)
        return interface

    def driver(self, device: Path, name: str) -> None:
        folder = self.root / "sys/bus/drivers" / name
        folder.mkdir(parents=True, exist_ok=True)
        (device / "driver").symlink_to(folder)

    def node(self, name: str, mode: int = 0o660) -> Path:
        node = self.write(f"dev/{name}")
        node.chmod(mode)
        return node

    def serial_port(self, name: str, by_id: str | None = None, mode: int = 0o660) -> Path:
        node = self.node(name, mode)
        self.link(f"sys/class/tty/{name}/device", self.usb(f"1-{len(name)}.{name[-1]}", "ch341-uart"))
        if by_id is not None:
            self.link(f"dev/serial/by-id/{by_id}", node)
        return node

    def camera(self, name: str, index: int = 0, by_id: str | None = None) -> Path:
        node = self.node(name)
        self.write(f"sys/class/video4linux/{name}/index", f"{index}\n")
        self.write(f"sys/class/video4linux/{name}/name", "Acme Camera\n")
        self.link(f"sys/class/video4linux/{name}/device", self.usb(f"2-{name[-1]}", "uvcvideo"))
        if by_id is not None:
            self.link(f"dev/v4l/by-id/{by_id}", node)
        return node

    def interface(self, name: str, kind: int, flags: int, driver: str | None = None) -> None:
        self.write(f"sys/class/net/{name}/type", f"{kind}\n")
        self.write(f"sys/class/net/{name}/flags", f"{flags:#x}\n")
        if driver is not None:
            device = self.root / f"sys/class/net/{name}/device"
            device.mkdir()
            self.driver(device, driver)

    def process(self, pid: int, name: str, *opened: Path) -> None:
        self.write(f"proc/{pid}/comm", f"{name}\n")
        for number, path in enumerate(opened):
            self.link(f"proc/{pid}/fd/{number}", path)
