"""What pyserial does when a device goes, and what an opening hears that is over."""

import asyncio
import termios
import threading
from collections.abc import Iterator
from typing import Any

import pytest
import serial

from drivers.errors import DeviceLostError
from drivers.grbl import port as module
from drivers.grbl.port import SerialPort

GONE = (
    serial.SerialException("device reports readiness to read but returned no data"),
    OSError(5, "Input/output error"),
    termios.error(5, "Input/output error"),
    TypeError("'NoneType' object cannot be interpreted as an integer"),
)


class Device:
    """Stands in for `serial.Serial`: a read blocks until there is something, or an error."""

    def __init__(self) -> None:
        self.there = threading.Event()
        self.brings: bytes | Exception = b""
        self.takes: Exception | None = None
        self.waiting: Exception | None = None
        self.opened: dict[str, Any] = {}
        self.closed = False

    @property
    def in_waiting(self) -> int:
        if self.waiting is not None:
            raise self.waiting
        return 0

    def read(self, _size: int) -> bytes:
        self.there.wait(30)
        self.there.clear()
        if isinstance(self.brings, Exception):
            raise self.brings
        return self.brings

    def bring(self, what: bytes | Exception) -> None:
        self.brings = what
        self.there.set()

    def write(self, data: bytes) -> int:
        if self.takes is not None:
            raise self.takes
        return len(data)

    def cancel_read(self) -> None:
        self.there.set()

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def device(monkeypatch: pytest.MonkeyPatch) -> Iterator[Device]:
    device = Device()

    def open_device(_path: str, _baud_rate: int, **keys: Any) -> Device:
        device.opened = keys
        return device

    monkeypatch.setattr(module.serial, "Serial", open_device)
    yield device
    assert device.closed


async def test_a_port_is_opened_for_this_program_alone(device: Device) -> None:
    port = SerialPort("/dev/ttyACM0", 115200, lambda _: None, lambda _: None)
    await port.open()
    await port.close()
    assert device.opened["exclusive"] is True


@pytest.mark.parametrize("where", ["read", "in_waiting"])
@pytest.mark.parametrize("error", GONE, ids=lambda error: type(error).__name__)
async def test_whatever_a_read_raises_the_port_is_lost(device: Device, error: Exception, where: str) -> None:
    lost = asyncio.get_running_loop().create_future()
    port = SerialPort("/dev/ttyACM0", 115200, lambda _: None, lost.set_result)
    await port.open()
    if where == "read":
        device.bring(error)
    else:
        device.waiting = error
        device.bring(b"")
    assert str(await lost) == f"the port /dev/ttyACM0 is gone ({error}): plug it in again"
    await port.close()


@pytest.mark.parametrize("error", GONE, ids=lambda error: type(error).__name__)
async def test_whatever_a_write_raises_the_port_is_lost(device: Device, error: Exception) -> None:
    port = SerialPort("/dev/ttyACM0", 115200, lambda _: None, lambda _: None)
    await port.open()
    device.takes = error
    with pytest.raises(DeviceLostError, match="the port /dev/ttyACM0 is gone"):
        port.write(b"?")
    await port.close()


async def test_bytes_that_come_as_the_port_is_closed_are_not_heard(device: Device) -> None:
    heard: list[bytes] = []
    port = SerialPort("/dev/ttyACM0", 115200, heard.append, lambda _: None)
    await port.open()
    device.brings = b"ok\r\n"  # what the read brings that is cancelled
    await port.close()
    assert heard == []
