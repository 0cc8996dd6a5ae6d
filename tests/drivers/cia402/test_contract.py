"""The CiA 402 driver passes the contract of axes, on emulated drives, over every kind of bus that needs no kernel."""

from collections.abc import AsyncIterator
from typing import Any, ClassVar

import pytest

from drivers.contract import AxisBench, AxisContract
from tests.drivers.cia402.rigs import Rig


class OnTheBus(AxisContract):
    options: ClassVar[dict[str, Any]] = {}
    axis_options: ClassVar[dict[str, Any]] = {}
    axis = "slide"

    @pytest.fixture(autouse=True)
    async def switched_on(self) -> AsyncIterator[None]:
        self.rig = Rig(self.axis_options, self.axis_options, **self.options)
        await self.rig.start()
        yield
        await self.rig.emulator.close()

    def bench(self) -> AxisBench:
        return AxisBench(self.rig.controller, self.axis, self.rig.clock, self.take_away)

    def take_away(self) -> None:
        """Take the bus away in a way that is noticed before a silence is."""
        self.rig.emulator.go_off()


class TestOverAVirtualBus(OnTheBus):
    pass


class TestOverMulticast(OnTheBus):
    options: ClassVar[dict[str, Any]] = {"interface": "udp_multicast", "channel": "239.74.163.2"}
    axis = "pan"


class TestOverASerialAdapter(OnTheBus):
    options: ClassVar[dict[str, Any]] = {"interface": "slcan", "channel": "set by the emulator"}

    def take_away(self) -> None:
        self.rig.emulator.unplug()


class TestDrivesThatNeverAcknowledge(OnTheBus):
    axis_options: ClassVar[dict[str, Any]] = {"acknowledges": False}

    @pytest.fixture(autouse=True)
    def mum(self, switched_on: None) -> None:
        for node in self.rig.emulator.nodes.values():
            node.servo.acknowledges = False
