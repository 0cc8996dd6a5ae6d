"""The kinematic chain as a product of exponentials: the camera's pose as a function of the readings.

Every joint is a screw in the world at all readings 0. A reading v of joint i moves all that rides on it by
exp(s_i v Z_i) about or along its axis, so that

    world_from_camera(V) = E_1(v_1) E_2(v_2) ... E_m(v_m) world_from_camera(0).

numpy alone: this is what `GET /pose` evaluates.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.errors import ReadingsError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Chain:
    """Joints in chain order: `revolute` (m,), unit `axes` (m, 3), `points` (m, 3) in m, `scales` (m,)."""

    revolute: NDArray[np.bool_]
    axes: Array
    points: Array
    scales: Array

    @classmethod
    def of(
        cls,
        kinds: Sequence[str],
        axes: Sequence[ArrayLike],
        points: Sequence[ArrayLike],
        scales: Sequence[float],
    ) -> Self:
        """Return the chain of these joints; the axes are made unit vectors."""
        directions = np.array(axes, dtype=float).reshape(-1, 3)
        return cls(
            revolute=np.array([kind == "revolute" for kind in kinds], dtype=bool),
            axes=directions / np.linalg.norm(directions, axis=1, keepdims=True),
            points=np.array(points, dtype=float).reshape(-1, 3),
            scales=np.array(scales, dtype=float),
        )

    def __len__(self) -> int:
        return len(self.revolute)

    def head(self, joints: int) -> "Chain":
        """Return the first `joints` joints."""
        return Chain(self.revolute[:joints], self.axes[:joints], self.points[:joints], self.scales[:joints])

    def motion(self, joint: int, readings: Array) -> Array:
        """Return the motions (n, 4, 4) of joint `joint` alone, from reading 0 to each of `readings` (n,)."""
        travel = self.scales[joint] * readings
        axis = self.axes[joint]
        motion = np.zeros((len(travel), 4, 4))
        motion[:, 3, 3] = 1
        if not self.revolute[joint]:
            motion[:, :3, :3] = np.eye(3)
            motion[:, :3, 3] = travel[:, None] * axis
            return motion
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        sine, versine = np.sin(travel)[:, None, None], (2 * np.sin(travel / 2) ** 2)[:, None, None]
        motion[:, :3, :3] = np.eye(3) + sine * cross + versine * (cross @ cross)
        motion[:, :3, 3] = self.points[joint] - motion[:, :3, :3] @ self.points[joint]
        return motion

    def displacement(self, readings: ArrayLike, joints: int | None = None) -> Array:
        """Return what moves all that rides on the first `joints` joints (all by default) from readings 0.

        (n, 4, 4) for readings (n, m), (4, 4) for one vector (m,). Raises ReadingsError for a wrong length.
        """
        values = self.checked(readings)
        single = values.ndim == 1
        values = np.atleast_2d(values)
        result = np.broadcast_to(np.eye(4), (len(values), 4, 4))
        for joint in range(len(self) if joints is None else joints):
            result = result @ self.motion(joint, values[:, joint])
        return result[0] if single else result

    def checked(self, readings: ArrayLike) -> Array:
        """Return `readings` (n, m) or (m,) as an array; raises ReadingsError unless they are m finite numbers each."""
        values = np.asarray(readings, dtype=float)
        if values.ndim not in (1, 2) or values.shape[-1] != len(self) or not np.all(np.isfinite(values)):
            got = "not all finite numbers" if values.shape[-1] == len(self) else f"{values.shape[-1]} numbers"
            raise ReadingsError(
                f"readings must be one finite number for each of the {len(self)} joints, not {got}"
            )
        return values

    def poses(self, readings: ArrayLike, joints: int, mount: Array) -> Array:
        """Return the poses at `readings` of what stands at `mount` (4, 4) at readings 0."""
        return self.displacement(readings, joints) @ mount
