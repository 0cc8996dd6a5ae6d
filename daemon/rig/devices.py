"""From a profile to its devices: drivers by name, their clock, and the world behind simulated ones."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from daemon.profile import Profile
from drivers.axis import AxisController
from drivers.camera import CameraSource
from drivers.clock import Clock, ScaledClock, SystemClock
from drivers.driver import DriverContext
from drivers.registry import camera_driver, controller_driver

if TYPE_CHECKING:
    from drivers.simulated.world import SimulatedWorld


@dataclass(frozen=True, slots=True)
class Devices:
    """Everything a rig is made of; nothing is open yet."""

    clock: Clock
    world: "SimulatedWorld | None"
    controllers: Mapping[str, AxisController]
    camera: CameraSource


def make_devices(profile: Profile, clock: Clock | None = None) -> Devices:
    """Make the devices of `profile`, whose own clock they share unless `clock` is given.

    Raises OptionsError where a driver cannot do what the profile asks.
    """
    context = _context(profile, clock)
    controllers = {}
    for name, controller in profile.controllers.items():
        axes = [axis for axis in profile.axes if axis.controller == name]
        controllers[name] = controller_driver(controller.driver).create(
            {axis.spec.name: axis.spec for axis in axes},
            controller.options,
            {axis.spec.name: axis.options for axis in axes},
            context,
        )
    camera = camera_driver(profile.camera.driver).create(profile.camera.spec, profile.camera.options, context)
    return Devices(context.clock, context.world, controllers, camera)


def _context(profile: Profile, clock: Clock | None) -> DriverContext:
    if profile.simulation is None:
        return DriverContext(clock or SystemClock())
    from drivers.simulated.world import SimulatedWorld

    scale = profile.simulation.time_scale
    # Drivers of real devices, which may be emulated elsewhere, stamp what they see by the system's clock.
    clock = clock or (SystemClock() if scale == 1.0 else ScaledClock(scale))
    specs = [axis.spec for axis in profile.axes]
    target = profile.target.model_dump()
    return DriverContext(clock, SimulatedWorld(profile.simulation, specs, target, clock))
