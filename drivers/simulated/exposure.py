"""One exposure: the camera's path while it lasts, and the picture that is left of it."""

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.renderer import Renderer
from drivers.simulated.sensor import Sensor
from drivers.simulated.world import SimulatedWorld

Array = NDArray[np.float64]
Grey = NDArray[np.float32]

_VISIBLE = 0.02
"""Pixels of motion during an exposure below which the camera counts as standing."""
_STEP = 0.5
"""Pixels between two instants of a blurred picture, as far as `_INSTANTS` allows: each costs a rendering."""
_INSTANTS = 8
_FINER = 2
"""Times by which light that a lens blurs is finer than the pixels: edges are off by 0.002 px, and by 0.014 px at 1."""


class Exposure:
    """Exposes pictures of a world on a sensor of width x height pixels."""

    def __init__(self, world: SimulatedWorld, width: int, height: int, instants: int = _INSTANTS) -> None:
        """`instants`: of how many a blurred picture is made at most."""
        self._world = world
        self._instants = instants
        picture = world.options.camera.picture
        finer = _FINER if picture.defocus > 0.0 else 1
        self._renderer = Renderer(world.plate, world.lens.finer(finer), finer * width, finer * height)
        self._sensor = Sensor(picture, width, height)
        self._still: tuple[bytes, Grey] | None = None

    def prepare(self) -> None:
        """Do what the first picture would be late for. Raises OptionsError for a lens without inverse."""
        self._renderer.prepare()

    def poses(self, begins: float, duration: float) -> list[Array]:
        """Return world_from_camera (4, 4) at instants of an exposure: only one where the camera stands."""
        path = [self._world.world_from_camera_at(begins + share * duration) for share in (0.0, 0.5, 1.0)]
        points = self._world.plate.outline()
        track = np.stack([self._world.project_from(points, pose) for pose in path])
        steps = np.linalg.norm(np.diff(track, axis=0), axis=2)
        travel = float(np.max(np.sum(steps, axis=0), initial=0.0, where=np.isfinite(steps).all(axis=0)))
        if travel < _VISIBLE:
            return [path[1]]
        count = min(self._instants, 2 + math.ceil(travel / _STEP))
        instants = begins + (np.arange(count) + 0.5) / count * duration
        return [self._world.world_from_camera_at(float(t)) for t in instants]

    def picture(self, poses: list[Array], noise: np.random.Generator) -> NDArray[np.uint8]:
        """Return what the sensor reads after an exposure from these poses, each for an equal time."""
        return self._sensor.read(self._light(poses), noise)

    def _light(self, poses: list[Array]) -> Grey:
        key = np.stack(poses).tobytes()
        # A camera that stands sees the same picture again and again, but for the noise.
        if self._still is None or self._still[0] != key:
            light = self._renderer.render(poses[0])
            for pose in poses[1:]:
                light += self._renderer.render(pose)
            light /= np.float32(len(poses))
            self._still = key, self._sensor.gather(light)
        return self._still[1]
