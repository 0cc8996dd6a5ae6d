"""What the fit moves: the chain, the cameras on it and their lenses, as a point and as a vector of small steps.

Steps are minimal: a revolute axis turns about two normals through its point and shifts along them (4), a prismatic
one turns (2), a scale changes by its logarithm (1), a camera moves in its own frame (6). Every parameter is
thus a twist of the chain somewhere, or a number of the lens.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from calib.chain import Chain
from calib.parameters import LENS_NAMES
from calib.transforms import any_normal
from calib.twists import exp_twist, skew

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class State:
    """The chain, each camera's pose at all readings 0 `mounts` (c, 4, 4), and its lens as a vector, None for none.

    `rests` (r,) are how far joints at rest stand from what was read, `corrections` (k,) coefficients of what is added
    to readings, `warp` (w,) of what is added to the target, and `aspects` (a,) by how much some sensors that give poses
    see y too large.
    """

    chain: Chain
    mounts: Array
    lenses: tuple[Array | None, ...]
    corrections: Array
    warp: Array
    aspects: Array = field(default_factory=lambda: np.zeros(0))
    rests: Array = field(default_factory=lambda: np.zeros(0))

    def moved(self, step: Array, layout: "Layout") -> "State":
        """Return the state after a step (p,) of the layout's parameters."""
        chain, joints = self.chain, len(self.chain)
        twists = [joint_basis(chain, joint) @ step[layout.shapes[joint]] for joint in range(joints)]
        motions = exp_twist(np.array([*twists, *(step[part] for part in layout.mounts)]))
        turns, shifts = motions[:joints, :3, :3], motions[:joints, :3, 3]
        axes = (turns @ chain.axes[..., None])[..., 0]
        return State(
            chain=replace(
                chain,
                axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
                points=(turns @ chain.points[..., None])[..., 0] + shifts,
                scales=chain.scales * np.exp(step[list(layout.scales)]),
            ),
            mounts=self.mounts @ motions[joints:],
            lenses=tuple(
                None if lens is None else lens + change @ step[part]
                for lens, part, change in zip(self.lenses, layout.lenses, layout.lens_changes, strict=True)
            ),
            corrections=self.corrections + step[layout.corrections],
            warp=self.warp + step[layout.warp],
            aspects=self.aspects + step[layout.aspects],
            rests=self.rests + step[layout.rests],
        )


@dataclass(frozen=True)
class Layout:
    """Where each part of the state lies in the vector of steps, and what each entry is called.

    `lens_changes` (l, l) are how each lens's numbers change with their steps: a number may follow another.
    """

    names: tuple[str, ...]
    shapes: tuple[slice, ...]
    scales: tuple[int, ...]
    mounts: tuple[slice, ...]
    lenses: tuple[slice, ...]
    lens_changes: tuple[Array, ...]
    rests: slice
    corrections: slice
    warp: slice
    aspects: slice

    def __len__(self) -> int:
        return len(self.names)

    @classmethod
    def of(
        cls,
        state: State,
        joints: Sequence[str],
        cameras: Sequence[str],
        models: Sequence[str | None],
        corrections: Sequence[str] = (),
        warp: Sequence[str] = (),
        lens_changes: Sequence[Array | None] | None = None,
    ) -> "Layout":
        """Return the layout of `state`, whose parts are called as given; lens numbers change as they step."""
        names: list[str] = []

        def take(owner: str, *entries: str) -> slice:
            names.extend(f"{owner}.{entry}" for entry in entries)
            return slice(len(names) - len(entries), len(names))

        shapes, scales = [], []
        for joint, revolute in zip(joints, state.chain.revolute, strict=True):
            entries = ["axis[0]", "axis[1]", "point[0]", "point[1]"] if revolute else ["axis[0]", "axis[1]"]
            shapes.append(take(joint, *entries))
            scales.append(take(joint, "scale").start)
        mounts = [take(camera, *(f"mount[{i}]" for i in range(6))) for camera in cameras]
        lenses = [
            take(camera, *(() if model is None else LENS_NAMES[model]))
            for camera, model in zip(cameras, models, strict=True)
        ]
        changes = [None] * len(lenses) if lens_changes is None else lens_changes
        return cls(
            shapes=tuple(shapes),
            scales=tuple(scales),
            mounts=tuple(mounts),
            lenses=tuple(lenses),
            lens_changes=tuple(
                np.eye(part.stop - part.start) if change is None else change
                for part, change in zip(lenses, changes, strict=True)
            ),
            rests=take("rest"),
            corrections=take("correction", *corrections),
            warp=take("warp", *warp),
            aspects=take("aspect"),
            names=tuple(names),
        )


def joint_basis(chain: Chain, joint: int) -> Array:
    """Return the twists (6, 4 or 2) in the world that move a joint's axis without sliding it along itself."""
    axis, point = chain.axes[joint], chain.points[joint]
    first = any_normal(axis)
    normals = np.column_stack([first, skew(axis) @ first])
    basis = np.zeros((6, 4 if chain.revolute[joint] else 2))
    basis[:3, :2] = normals
    if chain.revolute[joint]:
        basis[3:, :2], basis[3:, 2:] = skew(point) @ normals, normals
    return basis
