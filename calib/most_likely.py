"""The maximum-likelihood solution of a session, from the closed form's."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from math import sqrt
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from calib.corrections import Corrections, coefficient_paths
from calib.errors import UnsolvableError
from calib.likelihood.building import Start
from calib.likelihood.document_covariance import document_jacobian
from calib.likelihood.imperfections import Circumstances
from calib.likelihood.measurements import PointViews
from calib.likelihood.problem import Problem
from calib.likelihood.refinement import Refined, refine
from calib.likelihood.weakness import weaknesses
from calib.observations import Observation
from calib.residuals import read_as_predicted
from calib.session import Session
from calib.solution import Solution
from calib.stated_corrections import aspect_paths, warp_paths
from calib.targets import NoTarget, Target

Array = NDArray[np.float64]


def most_likely(
    session: Session, observations: Sequence[Observation], start: Solution, target_warp: bool = False
) -> Solution:
    """Return the most likely solution near the closed form's, with its covariance and what did not belong.

    Imperfect joints are corrected where the data support it, and with `target_warp` the target's bulge. Raises
    UnsolvableError where the views contradict each other, or what is known beforehand, beyond measure.
    """
    assert start.mounts is not None
    oriented = _as_the_chain_has_it(session, start, observations)
    try:
        refined = refine(
            session, oriented, Start(start.chain, start.mounts, start.lenses, start.prior), target_warp
        )
    except np.linalg.LinAlgError as error:
        # So far from what was measured the noise that would explain it has no bounds.
        raise UnsolvableError(
            "the views contradict each other, or what is held or known beforehand, too much to be fitted: "
            "are the readings, the target, and the values that are held right?"
        ) from error
    state, aside, found = refined.state, refined.set_aside, refined.imperfections
    unused, (stated, places) = refined.unused_warp, found.stated()
    return replace(
        start,
        chain=state.chain,
        mounts=state.mounts,
        lenses=refined.lenses(),
        covariance=_document_covariance(session, refined),
        left_out=(aside.views, aside.points),
        refined=refined,
        noise_px=_point_noise(refined.problem),
        weaknesses=weaknesses(session, refined),
        corrections=Corrections(stated, state.corrections[places]),
        sides=found.sides(Circumstances.of(session), state.corrections),
        slips=found.slipped(state.corrections, _deviations(refined)[refined.problem.layout.corrections]),
        warp=dict(zip(found.warp, state.warp.tolist(), strict=True)),
        unused_warp={}
        if unused is None
        else dict(zip(unused.imperfections.warp, unused.values, strict=True)),
        aspects={
            session.cameras[camera].name: float(aspect)
            for camera, aspect in zip(found.sensors, state.aspects, strict=True)
        },
    )


def _deviations(refined: Refined) -> Array:
    """Return the standard deviations (p,) of the layout's parameters."""
    return np.sqrt(np.maximum(np.diag(refined.covariance), 0))


def _point_noise(problem: Problem) -> float | None:
    """Return how far single points lie off (rms, px) for no other reason than noise; None where there are none."""
    squares, count = 0.0, 0.0
    for group in problem.groups:
        if isinstance(group.data, PointViews):
            # A point's noise is W^-1 times unit noise, and a 2 x 2 inverse is as large as W over its determinant.
            whitening = group.data.whitening
            spread = (whitening**2).sum(axis=(2, 3)) / np.linalg.det(whitening) ** 2
            squares += float((spread * group.data.present).sum())
            count += float(group.data.present.sum())
    return sqrt(squares / count) if count else None


def _as_the_chain_has_it(
    session: Session, start: Solution, observations: Sequence[Observation]
) -> list[Observation]:
    """Return the observations read the way round that the closed form's chain has them."""
    assert start.mounts is not None
    oriented = [observation for observation in observations if observation.pose is not None]
    for camera, lens in enumerate(start.lenses):
        own = [o for o in observations if o.camera == camera and o.pose is None]
        if own and lens is not None:
            readings = [session.views[observation.view].readings for observation in own]
            predicted = start.chain.poses(readings, session.camera_link(camera), start.mounts[camera])
            oriented += read_as_predicted(own, session.target, lens, predicted)
    return sorted(oriented, key=attrgetter("view"))


def _document_covariance(session: Session, refined: Refined) -> tuple[list[str], Array]:
    models = [None if lens is None else lens.model for lens in refined.lenses()]
    found = refined.imperfections
    layout, (stated, places) = refined.problem.layout, found.stated()
    where = {
        path: layout.corrections.start + k for path, k in zip(coefficient_paths(stated), places, strict=True)
    }
    where |= {path: layout.warp.start + k for k, path in enumerate(warp_paths(len(found.warp)))}
    where |= {path: layout.aspects.start + k for k, path in enumerate(aspect_paths(len(found.sensors)))}
    names, jacobian = document_jacobian(refined.state, layout, models, where)
    covariance = jacobian @ refined.covariance @ jacobian.T
    # A print that is larger than it says scales every length, and shows in no residual.
    size = _lengths(names, refined) * _print_scale_std(session.target)
    return names, covariance + np.outer(size, size)


def _lengths(names: list[str], refined: Refined) -> Array:
    """Return the document's numbers that are lengths, or lengths a reading, and zeros for the others."""
    state, values = refined.state, np.zeros(len(names))
    place = {name: index for index, name in enumerate(names)}
    for joint, revolute in enumerate(state.chain.revolute):
        axis, point = state.chain.axes[joint], state.chain.points[joint]
        point = point - (point @ axis) * axis if revolute else state.mounts[0, :3, 3]
        for i in range(3):
            values[place[f"joints.{joint}.point.{i}"]] = point[i]
        if not revolute:
            values[place[f"joints.{joint}.scale"]] = state.chain.scales[joint]
    for camera, mount in enumerate(state.mounts):
        for i in range(3):
            values[place[f"cameras.{camera}.world_from_camera.{i}.3"]] = mount[i, 3]
    for path, height in zip(warp_paths(len(state.warp)), state.warp, strict=True):
        values[place[path]] = height
    return values


def _print_scale_std(target: Target) -> float:
    """Return the relative standard deviation of the print's scale."""
    if isinstance(target, NoTarget) or target.pitch_std is None:
        return 0.0
    return target.pitch_std / target.pitch


def left_out_in_words(solution: Solution) -> list[str]:
    """Return a sentence for each view, and for each view's points, that did not belong."""
    views, points = solution.left_out
    sentences = [
        f"view {view} does not agree with the others and was set aside: its readings may be wrong, or it was knocked"
        for view in views
    ]
    return sentences + [
        f"view {view}: {count} of its points lie far from where all others say, and were set aside"
        for view, count in sorted(Counter(view for view, _ in points).items())
    ]
