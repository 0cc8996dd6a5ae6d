"""Axes of a Grbl controller pass the contract that every driver passes, over the emulator."""

from collections.abc import AsyncIterator
from typing import Any, ClassVar

import pytest

from drivers.contract import AxisBench, AxisContract
from tests.drivers.grbl.benches import Table, make


class OnTheEmulator(AxisContract):
    __test__ = False
    axis: ClassVar[str]
    changes: ClassVar[dict[int, float]] = {20: 0}
    """Without soft limits: with them Grbl refuses half of all jogs before it is homed."""
    options: ClassVar[dict[str, Any]] = {}

    @pytest.fixture(autouse=True)
    async def table(self) -> AsyncIterator[None]:
        self.made: Table = make(self.changes, **self.options)
        await self.made.emulator.start()
        yield
        await self.made.controller.close()
        await self.made.emulator.close()

    def bench(self) -> AxisBench:
        return AxisBench(
            self.made.controller, self.axis, self.made.world.clock, unplug=self.made.emulator.unplug
        )


class TestSlide(OnTheEmulator):
    __test__ = True
    axis = "slide"


class TestPanThatIsHomedAlone(OnTheEmulator):
    __test__ = True
    axis = "pan"
    options: ClassVar[dict[str, Any]] = {"single_axis_homing": True}


class TestSlideInWorkCoordinatesOnABoardThatRestarts(OnTheEmulator):
    __test__ = True
    axis = "slide"
    changes: ClassVar[dict[int, float]] = {20: 0, 10: 0}
    options: ClassVar[dict[str, Any]] = {"restarts": True}
