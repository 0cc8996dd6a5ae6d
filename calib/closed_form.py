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
from calib.held_chain import held_chain
from calib.screws import Screw, prismatic_screw, revolute_screw
from calib.session import Session
from calib.sweeps import readings_at_rest, sweep_labels
from calib.transforms import inverse, mean_transform
from calib.units import nominal_scale

Array = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class PoseViews:
    """Camera poses `world_from_camera` (n, 4, 4) with their readings (n, m).

    `exercised` (n,) is the joint moved alone in a view, -1 outside the plan; `cameras` (n,) who took it, and
    `links` how many joints move each camera.
    """

    poses: Array
    readings: Array
    exercised: Ints
    cameras: Ints
    links: Sequence[int]

    @classmethod
    def of(cls, session: Session, views: Sequence[int], poses: Array) -> "PoseViews":
        """Return the views numbered `views` of `session`, in which the camera was at `poses`."""
        taken = [session.views[index] for index in views]
        return cls(
            poses=poses,
            readings=session.with_views(taken).readings(),
            exercised=np.array(
                [-1 if v.joint is None else session.joint_index(v.joint) for v in taken], dtype=int
            ),
            cameras=np.array([session.camera_index(view) for view in taken], dtype=int),
            links=[session.camera_link(camera) for camera in range(len(session.cameras))],
        )


def solve_chain(session: Session, views: PoseViews) -> tuple[Chain, Array]:
    """Return the chain of the session's joints, and each camera's pose at all readings 0 (cameras, 4, 4).

    Raises UnsolvableError that names the joint or camera which the views do not determine.
    """
    labels = sweep_labels(views.readings, views.exercised, views.cameras, views.links)
    views = replace(views, readings=readings_at_rest(views.readings, labels))
    screws: list[Screw] = []
    for index, joint in enumerate(session.joints):
        own = np.flatnonzero(labels[:, index] >= 0)
        if not len(own):
            raise UnsolvableError(_too_few(joint.name, int((views.exercised == index).sum())))
        before = _chain(session, screws).displacement(views.readings[own, :index])
        poses, readings = inverse(before) @ views.poses[own], views.readings[own, index]
        if joint.kind == "revolute":
            unit = nominal_scale(joint.kind, joint.reading_unit)
            screws.append(revolute_screw(poses, readings, labels[own, index], joint.name, unit))
        else:
            screws.append(prismatic_screw(poses, readings, labels[own, index], joint.name))
    chain = _chain(session, screws)
    mounts = _mounts(session, chain, views)
    points = np.where(chain.revolute[:, None], chain.points, mounts[0, :3, 3])
    return replace(chain, points=points), mounts


def _mounts(session: Session, chain: Chain, views: PoseViews) -> Array:
    """Return each camera's mean pose at all readings 0 (cameras, 4, 4) (eq 67 to 69, corrected)."""
    for camera, known in enumerate(session.cameras):
        if not (views.cameras == camera).any():
            raise UnsolvableError(
                f"camera '{known.name}' has no view with the target in it: take some, or leave it out"
            )
    return np.array([mean_mount(chain, views, camera) for camera in range(len(views.links))])


def mean_mount(chain: Chain, views: PoseViews, camera: int) -> Array:
    """Return where a camera's own views have it at all readings 0 (4, 4), on the mean."""
    own = views.cameras == camera
    displacement = chain.displacement(views.readings[own], views.links[camera])
    return mean_transform(inverse(displacement) @ views.poses[own])


def _chain(session: Session, screws: Sequence[Screw]) -> Chain:
    chain = Chain.of(
        [joint.kind for joint in session.joints[: len(screws)]],
        [screw.axis for screw in screws],
        [screw.point for screw in screws],
        [screw.scale for screw in screws],
    )
    return held_chain(session, chain)


def _too_few(name: str, count: int) -> str:
    if count == 0:
        return (
            f"joint '{name}' was never moved alone with the target in view: "
            "exercise it from one start, at two readings or more"
        )
    seen = (
        "one view only" if count == 1 else f"{count} views, but no two from one start at different readings"
    )
    return f"joint '{name}' has {seen}: move it alone, from one start, to two readings or more"
