"""Pictures into a v4l2loopback device, as a camera's driver would put them there."""

import fcntl
import os
import struct
import threading
from types import TracebackType
from typing import Any, Self

import numpy as np

SET_FORMAT = 0xC0D05605
OUTPUT = 2
PROGRESSIVE = 1
SRGB = 8


class Pusher:
    """Writes one picture again and again, at `rate` a second, until it is given another one."""

    def __init__(self, device: str, picture: Any, rate: float = 25.0) -> None:
        height, width = picture.shape
        self._picture = picture
        self._period = 1.0 / rate
        self._stopping = threading.Event()
        self._fd = os.open(device, os.O_RDWR)
        form = struct.pack(
            "=I4x8I",
            OUTPUT,
            width,
            height,
            int.from_bytes(b"BGR3", "little"),
            PROGRESSIVE,
            3 * width,
            3 * width * height,
            SRGB,
            0,
        )
        fcntl.ioctl(self._fd, SET_FORMAT, bytearray(form.ljust(208, b"\0")))
        self._thread = threading.Thread(target=self._push, daemon=True)

    def show(self, picture: Any) -> None:
        """Write `picture` from now on."""
        self._picture = picture

    def __enter__(self) -> Self:
        self._write()  # before the first picture the device cannot be read
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stopping.set()
        self._thread.join()
        os.close(self._fd)

    def _push(self) -> None:
        while not self._stopping.wait(self._period):
            self._write()

    def _write(self) -> None:
        os.write(self._fd, np.repeat(self._picture[:, :, None], 3, axis=2).tobytes())
