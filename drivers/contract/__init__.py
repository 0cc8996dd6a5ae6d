"""The contract that every driver passes, whether simulated, emulated or real, as test classes to subclass.

A driver's own tests make the device, and get all of the contract's tests:

    class TestAcmeAxis(AxisContract):
        def bench(self) -> AxisBench:
            return AxisBench(controller=..., axis="pan", clock=SystemClock())

pytest collects them (`asyncio_mode = "auto"`); nothing here imports it.
"""

from drivers.contract.axes import AxisContract
from drivers.contract.axis_bench import AxisBench
from drivers.contract.cameras import CameraBench, CameraContract

__all__ = ["AxisBench", "AxisContract", "CameraBench", "CameraContract"]
