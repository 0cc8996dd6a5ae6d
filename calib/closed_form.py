"""The chain from camera poses, in closed form and with no initial guess (the paper's section 2.3, corrected).

Joints are taken in chain order. A joint's poses are first carried back through the joints before it to
their readings 0, so that its screw comes out in the world at all readings 0, wherever its sweep was started.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.chain import Chain
from calib.errors import UnsolvableError
from calib.screws import Screw, prismatic_screw, revolute_screw
from calib.transforms import inverse, mean_transform

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

SAME_START = 0.01
"""Two views belong to one sweep when their idle readings agree within this part of the joint's range."""


@dataclass(frozen=True, eq=False)
class PoseViews:
    """Camera poses with their readings: n views, m joints, cameras numbered from 0.

    `exercised` is the joint moved alone in a view, -1 outside the plan; `links` how many joints move each camera.
    """

    poses: Array
    readings: Array
    exercised: Ints
    cameras: Ints
    links: Sequence[int]


@dataclass(frozen=True)
class JointKindAndUnit:
    """What is known of a joint beforehand; `unit` is the SI measure of one reading, if its unit says so."""

    name: str
    kind: str
    unit: float | None


def solve_chain(joints: Sequence[JointKindAndUnit], views: PoseViews) -> tuple[Chain, Array]:
    """Return the chain, and each camera's pose at all readings 0 (cameras, 4, 4).

    Raises UnsolvableError that names the joint or camera which the views do not determine.
    """
    sweeps = _sweeps(joints, views)
    views = replace(views, readings=_readings_at_rest(views, sweeps))
    screws: list[Screw] = []
    for index, joint in enumerate(joints):
        chain = _chain(joints[:index], screws)
        own = np.flatnonzero(sweeps[:, index] >= 0)
        carried = inverse(chain.displacement(views.readings[own, :index])) @ views.poses[own]
        readings, labels = views.readings[own, index], sweeps[own, index]
        if joint.kind == "revolute":
            screws.append(revolute_screw(carried, readings, labels, joint.name, joint.unit))
        else:
            screws.append(prismatic_screw(carried, readings, labels, joint.name))
    chain = _chain(joints, screws)
    mounts = camera_mounts(chain, views)
    return _with_prismatic_points(chain, mounts[0, :3, 3]), mounts


def camera_mounts(chain: Chain, views: PoseViews) -> Array:
    """Return each camera's pose at all readings 0 (cameras, 4, 4), the mean over its views (eq 67 to 69, corrected)."""
    mounts = np.zeros((len(views.links), 4, 4))
    for camera, link in enumerate(views.links):
        own = views.cameras == camera
        if not own.any():
            raise UnsolvableError(f"camera {camera} has no view with the target in it: take some, or leave it out")
        displacement = chain.displacement(views.readings[own], link)
        mounts[camera] = mean_transform(inverse(displacement) @ views.poses[own])
    return mounts


def _chain(joints: Sequence[JointKindAndUnit], screws: Sequence[Screw]) -> Chain:
    return Chain.of(
        [joint.kind for joint in joints],
        [screw.axis for screw in screws],
        [screw.point for screw in screws],
        [screw.scale for screw in screws],
    )


def _with_prismatic_points(chain: Chain, point: Array) -> Chain:
    points = np.where(chain.revolute[:, None], chain.points, point)
    return Chain(chain.revolute, chain.axes, points, chain.scales)


def _sweeps(joints: Sequence[JointKindAndUnit], views: PoseViews) -> Ints:
    """Return for each view and joint (n, m) which of the joint's sweeps it belongs to, -1 for none."""
    sweeps = np.full(views.readings.shape, -1, dtype=np.intp)
    spans = np.ptp(views.readings, axis=0) if len(views.readings) else np.zeros(len(joints))
    links = np.asarray(views.links)
    for index, joint in enumerate(joints):
        own = np.flatnonzero((views.exercised == index) & (links[views.cameras] > index))
        idle = np.delete(views.readings[own] / np.where(spans > 0, spans, 1), index, axis=1)
        labels = _clusters(np.column_stack([idle, views.cameras[own]]), SAME_START)
        sweeps[own, index] = labels
        widest = max((np.ptp(views.readings[own[labels == s], index]) for s in np.unique(labels)), default=0.0)
        if widest == 0:
            raise UnsolvableError(_too_few(joint.name, len(own)))
    return sweeps


def _too_few(name: str, count: int) -> str:
    if count == 0:
        return (
            f"joint '{name}' was never moved alone with the target in view: "
            "exercise it from one start, at two readings or more"
        )
    seen = "one view" if count == 1 else f"{count} views, no two of them from the same start at different readings"
    return f"joint '{name}' has {seen}: move it alone, from one start, to two readings or more"


def _clusters(rows: Array, tolerance: float) -> Ints:
    """Return a label for each row (n,): rows within `tolerance` of a cluster's first row in all columns share one."""
    labels = np.zeros(len(rows), dtype=np.intp)
    heads: list[Array] = []
    for index, row in enumerate(rows):
        near = [label for label, head in enumerate(heads) if np.abs(row - head).max(initial=0) <= tolerance]
        labels[index] = near[0] if near else len(heads)
        if not near:
            heads.append(row)
    return labels


def _readings_at_rest(views: PoseViews, sweeps: Ints) -> Array:
    """Return the readings (n, m) with those of idle joints replaced by their sweep's mean.

    An idle joint stands still: what its readings jitter is their own noise, and the mean has less of it.
    """
    at_rest = views.readings.copy()
    for joint in range(sweeps.shape[1]):
        for sweep in np.unique(sweeps[sweeps[:, joint] >= 0, joint]):
            members = sweeps[:, joint] == sweep
            own = at_rest[members, joint]
            # A shift by the first member keeps readings that did not jitter exactly as they are.
            base = at_rest[members][0]
            at_rest[members] = base + (at_rest[members] - base).mean(axis=0)
            at_rest[members, joint] = own
    return at_rest
