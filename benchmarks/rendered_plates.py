"""Plates of all five kinds as the simulated drivers render them, with the truth about every point."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.true_rig import Array
from calib.targets import (
    AprilGrid,
    AsymmetricCircleGrid,
    Charuco,
    Chessboard,
    CircleGrid,
    target_points,
)
from drivers.simulated.lens import Lens
from drivers.simulated.options import PictureOptions, PlateOptions
from drivers.simulated.plate import Plate
from drivers.simulated.renderer import Renderer
from drivers.simulated.sensor import Grey, Sensor
from drivers.simulated.target import parse_target

TARGETS: Final = (
    CircleGrid(rows=6, columns=7, pitch=0.03, disk_diameter=0.018),
    AsymmetricCircleGrid(rows=7, columns=5, pitch=0.04, disk_diameter=0.016),
    Chessboard(rows=6, columns=9, pitch=0.025),
    Charuco(rows=5, columns=7, pitch=0.03, marker=0.021, dictionary="DICT_5X5_100"),
    AprilGrid(rows=4, columns=5, tag=0.03, spacing=0.009),
)
"""One of each kind."""
Printed = CircleGrid | AsymmetricCircleGrid | Chessboard | Charuco | AprilGrid

DISTORTION: Final = (-0.1, 0.05)
FOCAL: Final = 1.5
"""Focal length over the picture's width."""
FINER: Final = 2
RENDERED_FINE: Final = 2000
"""Pictures up to so many pixels wide are rendered with pixels so many times finer."""
TILTED_ABOUT: Final = np.array([0.8, 0.6, 0.0])
ROLL: Final = 7.0
"""Degrees about the line of sight."""
RIM_POINTS: Final = 720
BRIGHTEST: Final = 235.0
"""Grey level of the paper where there is most light, so that nothing is saturated."""


@dataclass(frozen=True)
class Scene:
    """How a plate is seen: `tilt` in degrees, `blur` (px) and `noise` (grey levels) as standard deviations.

    `gradient` is the light's relative change from the picture's middle to its right edge, and `fill` the part
    of the picture that the points span, each way at most.
    """

    width: int = 1280
    tilt: float = 30.0
    blur: float = 0.8
    noise: float = 2.0
    gradient: float = 0.2
    fill: float = 0.7


class SeenPlate:
    """One plate in one scene."""

    def __init__(self, target: Printed, scene: Scene) -> None:
        self.target, self.scene = target, scene
        self._width, self._height = scene.width, scene.width * 3 // 4
        focal = FOCAL * scene.width
        centre = (self._width / 2 - 0.37, self._height / 2 - 0.81)
        self._lens = Lens("opencv", focal, focal, *centre, DISTORTION)
        self._plate = Plate(parse_target(target.model_dump(exclude={"pitch_std"})), PlateOptions())
        self._camera_from_world = self._pose(focal)
        options = PictureOptions(
            noise=scene.noise,
            defocus=f"{scene.blur} px",
            light_gradient=scene.gradient,
            brightness=BRIGHTEST / PlateOptions().paper / (1 + scene.gradient),
        )
        self._sensor = Sensor(options, self._width, self._height)

    def light(self, shift: tuple[float, float] = (0.0, 0.0)) -> Grey:
        """Return the picture free of noise, all of it shifted (px) but for the light's gradient."""
        finer = 1 if self.scene.width > RENDERED_FINE else FINER
        shifted = replace(self._lens, cx=self._lens.cx + shift[0], cy=self._lens.cy + shift[1])
        renderer = Renderer(self._plate, shifted.finer(finer), finer * self._width, finer * self._height)
        return self._sensor.gather(renderer.render(np.linalg.inv(self._camera_from_world)))

    def picture(self, light: Grey, noise: np.random.Generator) -> NDArray[np.uint8]:
        """Return one picture of the light, with its own noise."""
        return self._sensor.read(light, noise)

    def points(self) -> Array:
        """Return what is to be measured (n, 2) by id: disks' centroids, or corners."""
        centres = target_points(self.target)
        if not isinstance(self.target, CircleGrid | AsymmetricCircleGrid):
            return self._project(centres)
        angles = 2 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
        rim = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(RIM_POINTS)])
        rims = centres[:, None] + self.target.disk_diameter / 2 * rim
        return _centroids(self._project(rims.reshape(-1, 3)).reshape(len(centres), RIM_POINTS, 2))

    def _project(self, points: Array) -> Array:
        turn, shift = self._camera_from_world[:3, :3], self._camera_from_world[:3, 3]
        return self._lens.project(points @ turn.T + shift)

    def _pose(self, focal: float) -> Array:
        """Look at the target's middle, from where it fills the scene's part of the picture when not tilted."""
        points = target_points(self.target)
        spans = np.ptp(points[:, :2], axis=0) / (self._width, self._height)
        turn = Rotation.from_euler("z", ROLL, degrees=True)
        turn *= Rotation.from_rotvec(self.scene.tilt * TILTED_ABOUT, degrees=True)
        pose = np.eye(4)
        pose[:3, :3] = turn.as_matrix()
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        pose[:3, 3] = [0, 0, focal * spans.max() / self.scene.fill] - pose[:3, :3] @ middle
        return pose


def _centroids(polygons: Array) -> Array:
    """Return the centroids (n, 2) of the areas of polygons (n, k, 2)."""
    origins = polygons.mean(axis=1, keepdims=True)
    here = polygons - origins
    following = np.roll(here, -1, axis=1)
    cross = here[..., 0] * following[..., 1] - here[..., 1] * following[..., 0]
    moments = np.einsum("nk,nkc->nc", cross, here + following)
    return np.asarray(origins[:, 0] + moments / (3 * cross.sum(axis=1, keepdims=True)))
