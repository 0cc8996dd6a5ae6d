"""The fit's covariance in the document's own numbers, so that every reader can carry it on."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from calib.likelihood.state import Layout, State, joint_basis
from calib.parameters import LENS_NAMES, lens_paths
from calib.twists import skew

Array = NDArray[np.float64]


def document_jacobian(
    state: State, layout: Layout, models: Sequence[str | None], corrections: Mapping[str, int] | None = None
) -> tuple[list[str], Array]:
    """Return the dotted paths of a calibration's numbers, and their derivatives (d, p) by the parameters.

    `corrections` are the places among the parameters of the readings' corrections, of the target's warp and of sensors'
    aspects, by path.
    """
    names: list[str] = []
    rows: list[Array] = []

    def add(paths: list[str], derivative: Array) -> None:
        names.extend(paths)
        rows.extend(derivative)

    count = len(layout)
    for joint in range(len(state.chain)):
        axis, point, shape = state.chain.axes[joint], state.chain.points[joint], layout.shapes[joint]
        basis = joint_basis(state.chain, joint)
        by_axis, by_point = np.zeros((3, count)), np.zeros((3, count))
        by_axis[:, shape] = -skew(axis) @ basis[:3]
        if state.chain.revolute[joint]:
            moved = np.zeros((3, count))
            moved[:, shape] = basis[3:] - skew(point) @ basis[:3]
            # The document's point is the foot of the world's origin on the axis.
            by_point = moved - np.outer(axis, axis @ moved + point @ by_axis) - (point @ axis) * by_axis
        else:
            by_point[:, layout.mounts[0]] = state.mounts[0, :3, :3] @ np.eye(6)[3:]
        by_scale = np.zeros((1, count))
        by_scale[0, layout.scales[joint]] = state.chain.scales[joint]
        add([f"joints.{joint}.axis.{i}" for i in range(3)], by_axis)
        add([f"joints.{joint}.point.{i}" for i in range(3)], by_point)
        add([f"joints.{joint}.scale"], by_scale)
    for camera, mount in enumerate(state.mounts):
        _add_mount(add, camera, mount[:3, :3], layout.mounts[camera], count)
        model = models[camera]
        if model is not None:
            by_lens = np.zeros((len(LENS_NAMES[model]), count))
            by_lens[:, layout.lenses[camera]] = layout.lens_changes[camera]
            add([f"cameras.{camera}.intrinsics.{path}" for path in lens_paths(model)], by_lens)
    places = corrections or {}
    add(list(places), np.eye(count)[list(places.values())])
    return names, np.array(rows)


def _add_mount(
    add: Callable[[list[str], Array], None], camera: int, rotation: Array, part: slice, count: int
) -> None:
    """Add a camera's pose at readings 0: M Exp(xi) moves column c of R by R (omega x e_c), t by R rho."""
    derivative = np.zeros((3, 4, count))
    twist = np.eye(6)
    for column in range(3):
        derivative[:, column, part] = -rotation @ skew(np.eye(3)[column]) @ twist[:3]
    derivative[:, 3, part] = rotation @ twist[3:]
    paths = [f"cameras.{camera}.world_from_camera.{row}.{column}" for row in range(3) for column in range(4)]
    add(paths, derivative.reshape(12, count))
