"""A profile's devices, emulated: what `activecam simulate` runs, and the profile by which it is served."""

from collections.abc import AsyncIterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import tomlkit

from daemon.profile import Profile, ProfileError
from drivers.clock import SystemClock
from drivers.driver import DriverContext
from drivers.emulators.emulator import Emulator
from drivers.emulators.registry import camera_emulator, controller_emulator

if TYPE_CHECKING:
    from drivers.simulated.world import SimulatedWorld

CAMERA: Final = "camera"
"""What the camera is called where devices are named; controllers go by their own names."""


@dataclass(frozen=True, slots=True)
class EmulatedRig:
    """Emulators that run, and where they are."""

    world: "SimulatedWorld"
    """What they act in, and look at."""
    emulators: Mapping[str, Emulator]
    controllers: Mapping[str, Mapping[str, Any]]
    """Keys of each `[controllers.NAME]` by which its driver finds the emulator."""
    camera: Mapping[str, Any]
    """The same of `[camera]`."""

    def profile_to_serve(self, text: str) -> str:
        """Return a profile's text with the emulators in place of its devices; all else stays as it was."""
        document: Any = tomlkit.parse(text)
        for name, keys in self.controllers.items():
            document["controllers"][name].update(keys)
        document["camera"].update(self.camera)
        return tomlkit.dumps(document)


@asynccontextmanager
async def emulated(profile: Profile) -> AsyncIterator[EmulatedRig]:
    """Emulate every device of `profile` until the end of the block, all in one world.

    Raises ProfileError where the profile says nothing of the world, OptionsError where a device has no emulator.
    """
    if profile.simulation is None:
        raise ProfileError(
            [
                f"'{profile.name}' has no table [simulation]: add one, since an emulator needs to know the truth"
            ]
        )
    from drivers.simulated.world import SimulatedWorld

    clock = SystemClock()
    specs = [axis.spec for axis in profile.axes]
    world = SimulatedWorld(profile.simulation, specs, profile.target.model_dump(), clock)
    emulators = _make(profile, DriverContext(clock, world))
    async with AsyncExitStack() as running:
        places = {}
        for name, emulator in emulators.items():
            running.push_async_callback(emulator.close)
            places[name] = await emulator.start()
        camera = places.pop(CAMERA)
        yield EmulatedRig(world, emulators, places, camera)


def _make(profile: Profile, context: DriverContext) -> dict[str, Emulator]:
    emulators: dict[str, Emulator] = {}
    for name, controller in profile.controllers.items():
        axes = [axis for axis in profile.axes if axis.controller == name]
        emulators[name] = controller_emulator(controller.driver).create(
            {axis.spec.name: axis.spec for axis in axes},
            controller.options,
            {axis.spec.name: axis.options for axis in axes},
            context,
        )
    camera = profile.camera
    emulators[CAMERA] = camera_emulator(camera.driver).create(camera.spec, camera.options, context)
    return emulators
