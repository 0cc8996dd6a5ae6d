"""The simulated devices pass the contract that every driver passes."""

from drivers.contract import AxisBench, AxisContract, CameraBench, CameraContract
from tests.drivers import rigs
from tests.drivers.clocks import VirtualClock

SMALL_LENS = {"fx": "350 px", "fy": "350 px", "cx": "160 px", "cy": "120 px"}


class TestSimulatedSlide(AxisContract):
    def bench(self) -> AxisBench:
        clock = VirtualClock()
        controller = rigs.controller(rigs.world(clock))
        return AxisBench(controller, "slide", clock, unplug=lambda: controller.inject("lost"))


class TestSimulatedPanWithImperfections(AxisContract):
    def bench(self) -> AxisBench:
        clock = VirtualClock()
        pan = {
            "backlash": "0.2 deg",
            "encoder_resolution": "0.002 deg",
            "settling": {"amplitude": "0.1 deg"},
            "eccentricity": {"amplitude": "1 mrad"},
        }
        controller = rigs.controller(rigs.world(clock, pan=pan))
        return AxisBench(controller, "pan", clock, unplug=lambda: controller.inject("lost"))


class TestSimulatedCamera(CameraContract):
    def bench(self) -> CameraBench:
        clock = VirtualClock()
        camera = rigs.camera(rigs.world(clock, lens=SMALL_LENS), width=320, height=240)
        return CameraBench(camera, clock, unplug=lambda: camera.inject("lost"))
