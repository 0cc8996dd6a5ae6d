"""Drivers against devices of a real kernel: run by `make test-kernel` in a virtual machine, which may be broken."""

import os
from collections.abc import Iterator

import pytest

from tests.kernel.modules import load, unload

IN_THE_MACHINE = "VMRUN" in os.environ
"""Set in the virtual machine: nobody's own kernel has its modules taken out."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip everything outside of the virtual machine."""
    for item in items:
        if "kernel" in item.path.parts and not IN_THE_MACHINE:
            item.add_marker(pytest.mark.skip(reason="needs the devices of a kernel: make test-kernel"))


@pytest.fixture
def vivid() -> Iterator[str]:
    """The kernel's own test camera, by a name that outlasts its unplugging."""
    load("vivid", "n_devs=1")
    yield "/dev/v4l/by-path/platform-vivid.0-video-index0"
    unload("vivid")


@pytest.fixture
def loopback() -> Iterator[str]:
    """A camera that shows what is written into it."""
    load("v4l2loopback", "video_nr=20", "card_label=plate", "max_buffers=4")
    yield "/dev/video20"
    unload("v4l2loopback")
