"""The simulated world: where everything truly is. Devices act on it and look at it; nothing else may."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drivers.axis import AxisSpec
from drivers.clock import Clock
from drivers.errors import OptionsError
from drivers.simulated import kinematics
from drivers.simulated.lens import Lens
from drivers.simulated.options import JointOptions, SimulationOptions
from drivers.simulated.plate import Plate
from drivers.simulated.shaft import Gear, Shaft
from drivers.simulated.target import parse_target

Array = NDArray[np.float64]


class SimulatedWorld:
    """True axes, camera, lens and plate of one rig, and their state over time.

    `readings` are in the profile's axis order and in each axis's reading unit, as everywhere. Lengths are in
    metres, angles in radians, transforms (4, 4). Raises OptionsError where the options do not fit the axes.
    """

    def __init__(
        self,
        options: SimulationOptions,
        axes: Sequence[AxisSpec],
        target: Mapping[str, object],
        clock: Clock,
    ) -> None:
        if len(options.joints) != len(axes):
            raise OptionsError(
                f"[[simulation.joints]] describes {len(options.joints)} joints "
                f"and the rig has {len(axes)} axes: "
                "give one for each axis, in the same order"
            )
        self.options = options
        self.clock = clock
        self.lens = Lens.from_options(options.camera.lens)
        self.plate = Plate(parse_target(target), options.plate)
        self._axes = tuple(axes)
        self._screws = tuple(_screw(joint, spec) for joint, spec in zip(options.joints, axes, strict=True))
        self._shafts = {
            spec.name: Shaft(Gear.from_options(joint, spec))
            for joint, spec in zip(options.joints, axes, strict=True)
        }
        self._coupled = self._couplings()
        self._carrying = self._joints_below_camera()
        self._camera = self._camera_at_zero()

    def shaft(self, axis: str) -> tuple[int, Shaft]:
        """Return an axis's place in the readings, and its motor and load. Raises OptionsError."""
        if axis not in self._shafts:
            raise OptionsError(f"the simulated world has no axis '{axis}': it has {', '.join(self._shafts)}")
        return list(self._shafts).index(axis), self._shafts[axis]

    def displacements(self, readings: ArrayLike) -> Array:
        """Return the true displacements (n,) that belong to readings (n,): free of play, swing and noise."""
        values = self._vector(readings)
        gears = [shaft.gear for shaft in self._shafts.values()]
        own = [gear.displacement(float(value)) for gear, value in zip(gears, values, strict=True)]
        displacements: Array = self._coupled @ own
        return displacements

    def true_displacements(self, t: float) -> Array:
        """Return where the joints (n,) truly are at the clock's time `t`."""
        displacements: Array = self._coupled @ [shaft.displacement(t) for shaft in self._shafts.values()]
        return displacements

    def world_from_camera(self, readings: ArrayLike) -> Array:
        """Return the camera's true pose (4, 4) at readings (n,)."""
        return self._pose(self.displacements(readings))

    def world_from_camera_at(self, t: float) -> Array:
        """Return the camera's true pose (4, 4) at the clock's time `t`, in flight or at rest."""
        return self._pose(self.true_displacements(t))

    def project(self, points: ArrayLike, readings: ArrayLike) -> Array:
        """Return the pixels (n, 2) of world points (n, 3) at readings; nan where the lens cannot see them."""
        return self.project_from(points, self.world_from_camera(readings))

    def project_from(self, points: ArrayLike, world_from_camera: Array) -> Array:
        """Return the pixels (n, 2) of world points (n, 3) for a camera of this pose (4, 4)."""
        xyz = np.asarray(points, float).reshape(-1, 3)
        return self.lens.project((xyz - world_from_camera[:3, 3]) @ world_from_camera[:3, :3])

    def target_points(self) -> Array:
        """Return where the target's points truly are (n, 3), by id."""
        return self.plate.points()

    def _pose(self, displacements: Array) -> Array:
        pose = np.eye(4)
        for (spec, axis, point), displacement in zip(
            self._screws[: self._carrying], displacements[: self._carrying], strict=True
        ):
            pose = pose @ kinematics.screw(spec.kind, axis, point, float(displacement))
        carried: Array = pose @ self._camera
        return carried

    def _vector(self, readings: ArrayLike) -> Array:
        values = np.asarray(readings, float)
        if values.shape != (len(self._axes),) or not np.all(np.isfinite(values)):
            wanted = ", ".join(f"{spec.name} ({spec.unit})" for spec in self._axes)
            raise ValueError(f"readings must be one finite number for each axis: {wanted}")
        return values

    def _couplings(self) -> Array:
        """Return what each joint's own displacement moves each joint by (n, n)."""
        names = list(self._shafts)
        coupled = np.eye(len(names))
        for index, (name, joint) in enumerate(zip(names, self.options.joints, strict=True)):
            for other, part in joint.coupling.items():
                if other not in names or other == name:
                    raise OptionsError(
                        f"axis '{name}' is coupled to '{other}': choose another one of {', '.join(names)}"
                    )
                coupled[index, names.index(other)] = part
        return coupled

    def _joints_below_camera(self) -> int:
        names = [spec.name for spec in self._axes]
        link = self.options.camera.link
        if link is None:
            return len(names)
        if link not in names:
            raise OptionsError(
                f"[simulation.camera] 'link' is '{link}': choose one of the axes {', '.join(names)}"
            )
        return names.index(link) + 1

    def _camera_at_zero(self) -> Array:
        camera = self.options.camera
        if camera.rotation is not None:
            return kinematics.transform(kinematics.rotation_from_vector(camera.rotation), camera.position)
        assert camera.look_at is not None
        try:
            turn = kinematics.looking_at(camera.position, camera.look_at, camera.up)
        except ValueError as error:
            raise OptionsError(f"[simulation.camera]: {error}") from error
        return kinematics.transform(turn, camera.position)


def _screw(joint: JointOptions, spec: AxisSpec) -> tuple[AxisSpec, Array, Array]:
    axis = np.array(joint.axis)
    if joint.point is None and spec.kind == "revolute":
        raise OptionsError(
            f"axis '{spec.name}' is revolute and its [[simulation.joints]] entry has no 'point': "
            'give one of its axis, such as ["100 mm", "0 mm", "-500 mm"]'
        )
    return spec, axis / np.linalg.norm(axis), np.array(joint.point or (0.0, 0.0, 0.0))
