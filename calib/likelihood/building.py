"""From a session and a first solution to the likelihood, and the estimate it starts at."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.chain import Chain
from calib.lens_prior import lens_prior
from calib.likelihood.beforehand import beforehand
from calib.likelihood.idle import at_rest
from calib.likelihood.lens_terms import lens_vector
from calib.likelihood.measurements import GivenPoses, point_views
from calib.likelihood.problem import Estimate, Group, Problem, offsets_at
from calib.likelihood.state import Layout, State
from calib.observations import Observation
from calib.session import Intrinsics, Session
from calib.targets import disk_diameter, target_points

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Start:
    """Where the fit begins: the chain, each camera's pose at readings 0 (c, 4, 4), and its lens.

    `prior` (k, k) is what is known of the first k parameters, those of the joints and of the first camera's mount.
    """

    chain: Chain
    mounts: Array
    lenses: Sequence[Intrinsics | None]
    prior: Array | None = None


def built(session: Session, observations: Sequence[Observation], start: Start) -> tuple[Problem, Estimate]:
    """Return the likelihood of the session's fit views, and the estimate at `start`."""
    priors = [
        None if lens is None else lens_prior(session, camera, lens.model)
        for camera, lens in enumerate(start.lenses)
    ]
    lenses = tuple(
        None if lens is None or prior is None else prior.imposed(lens_vector(lens))
        for lens, prior in zip(start.lenses, priors, strict=True)
    )
    state = State(start.chain, start.mounts, lenses, np.zeros(0), np.zeros(0))
    models = [None if lens is None else lens.model for lens in start.lenses]
    joints, cameras = [joint.name for joint in session.joints], [camera.name for camera in session.cameras]
    changes = [None if prior is None else prior.by_step() for prior in priors]
    layout = Layout.of(state, joints, cameras, models, lens_changes=changes)
    known = beforehand(session, layout, state, priors, start.prior)
    points = target_points(session.target)
    groups: list[Group] = []
    for index in range(len(cameras)):
        own = [observation for observation in observations if observation.camera == index]
        link, lens = session.camera_link(index), start.lenses[index]
        seen = [observation for observation in own if observation.pose is None]
        if seen:
            groups.append(Group(index, link, lens, point_views(seen, points)))
        given = [observation for observation in own if observation.pose is not None]
        if given:
            views = np.array([observation.view for observation in given], dtype=np.intp)
            poses = np.array([observation.pose for observation in given])
            groups.append(Group(index, link, None, GivenPoses(views, poses, np.eye(6))))
    readings, rests = at_rest(session)
    problem = Problem(
        layout=layout,
        groups=tuple(groups),
        readings=readings,
        regressors=np.zeros((*readings.shape, 0)),
        rests=rests,
        at_rest=np.zeros((*readings.shape, 0)),
        noisiness=np.ones_like(readings),
        looseness=0.0,
        reading_std=np.array([joint.reading_std or 0.0 for joint in session.joints]),
        free=known.free,
        prior=known.information,
        disk_diameter=disk_diameter(session.target),
        bulges=np.zeros((len(points), 0)),
    )
    estimate = Estimate(state, np.zeros_like(readings), known.travel, offsets=())
    return problem, replace(estimate, offsets=offsets_at(problem, estimate))
