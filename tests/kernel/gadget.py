"""A USB serial device made of the kernel's own gadget and a host controller without wires: plugged and unplugged."""

import asyncio
import contextlib
import os
import time
import tty
from pathlib import Path
from typing import Final

from tests.kernel.modules import load, run, settle, unload

_CONFIGURED: Final = Path("/sys/kernel/config")
_GADGET: Final = _CONFIGURED / "usb_gadget" / "activecam"
_FUNCTION: Final = _GADGET / "functions" / "acm.0"
_CONFIGURATION: Final = _GADGET / "configs" / "c.1"
_CONTROLLER: Final = "dummy_udc.0"
_DEVICE_END: Final = "/dev/ttyGS0"
_LANGUAGE: Final = "strings/0x409"


class Gadget:
    """A board with one serial port, by the name that its serial number gives it; `make` and `remove` it."""

    def __init__(self, serial_number: str = "A1") -> None:
        self.by_id = Path(f"/dev/serial/by-id/usb-Acme_Grbl_board_{serial_number}-if00")
        self._serial_number = serial_number

    @property
    def port(self) -> str:
        """The name that the kernel gives the port; raises FileNotFoundError while it is unplugged."""
        return str(self.by_id.resolve(strict=True))

    def make(self) -> None:
        """Load the kernel's modules and describe the board, which is not plugged in yet."""
        for module in ("dummy_hcd", "libcomposite", "cdc_acm"):
            load(module)
        if not _CONFIGURED.is_mount():
            run("mount", "-t", "configfs", "none", str(_CONFIGURED))
        for folder in (_GADGET / _LANGUAGE, _CONFIGURATION, _FUNCTION):
            folder.mkdir(parents=True)
        for key, value in {"idVendor": "0x1d50", "idProduct": "0x614e"}.items():
            (_GADGET / key).write_text(value)
        self._set("manufacturer", "Acme")
        self._set("product", "Grbl board")
        self._set("serialnumber", self._serial_number)
        (_CONFIGURATION / _FUNCTION.name).symlink_to(_FUNCTION)

    def remove(self) -> None:
        """Unplug it and take it apart."""
        self.unplug()
        (_CONFIGURATION / _FUNCTION.name).unlink()
        for folder in (_CONFIGURATION, _FUNCTION, _GADGET / _LANGUAGE, _GADGET):
            folder.rmdir()
        unload("dummy_hcd")

    def plug(self) -> None:
        """Plug it in, and return when the port has its names."""
        (_GADGET / "UDC").write_text(_CONTROLLER)
        for _ in range(100):  # the host looks at its ports a moment later
            settle()
            if self.by_id.exists():
                return
            time.sleep(0.1)
        raise AssertionError(f"{self.by_id} does not come")

    def unplug(self) -> None:
        """Pull it out; udev takes the port's names away a little later."""
        with contextlib.suppress(OSError):  # it is out already
            (_GADGET / "UDC").write_text("\n")

    def rename(self, serial_number: str) -> None:
        """Be another board of the same make."""
        self._serial_number = serial_number
        self._set("serialnumber", serial_number)
        self.by_id = Gadget(serial_number).by_id

    def _set(self, key: str, value: str) -> None:
        (_GADGET / _LANGUAGE / key).write_text(value)


class SerialCable:
    """Carries bytes between an emulator's own port and the device's end of a gadget, while it is connected."""

    def __init__(self, emulated: str) -> None:
        self._loop = asyncio.get_running_loop()
        self._ends: list[int] = []
        for path in (emulated, _DEVICE_END):
            end = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            tty.setraw(end)
            self._ends.append(end)
        for source, sink in (self._ends, self._ends[::-1]):
            self._loop.add_reader(source, self._carry, source, sink)

    def cut(self) -> None:
        """Carry nothing any more."""
        for end in self._ends:
            self._loop.remove_reader(end)
            os.close(end)
        self._ends.clear()

    def _carry(self, source: int, sink: int) -> None:
        with contextlib.suppress(BlockingIOError):
            os.write(sink, os.read(source, 4096))
