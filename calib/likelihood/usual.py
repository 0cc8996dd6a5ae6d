"""The most usual rig that explains the views: what is asked about other views where these leave something open.

A lens that the views hardly tell may come out with any focal length, and bend wildly beyond what they saw. What such
a rig would see elsewhere says nothing of the real one. So the lens is drawn, weakly, to one as most cameras have it:
where the views tell it this changes nothing, and elsewhere it moves only along what they leave open.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.likelihood.descent import Descent, descend
from calib.likelihood.normal import normal_equations
from calib.likelihood.problem import Problem, Weights, evaluate

Array = NDArray[np.float64]

FOCAL = 0.6
"""How far focal lengths lie from the longer side of the picture, relative to it."""
ASPECT = 0.01
"""And from each other."""
CENTRE = 0.05
"""How far the principal point lies from the middle of the picture, relative to its longer side."""
BEND = 0.2
"""How large a coefficient of the distortion is."""


def usual_rig(problem: Problem, descent: Descent, weights: Weights) -> Descent:
    """Return the rig with the most usual lenses, as if the way down had ended there; no prior of lenses in it."""
    prior, travel = problem.prior.copy(), descent.estimate.travel.copy()
    drawn = False
    for group in problem.groups:
        part, values = problem.layout.lenses[group.camera], descent.estimate.state.lenses[group.camera]
        if values is None or group.lens is None or not problem.free[part].any() or problem.prior[part].any():
            continue
        change = problem.layout.lens_changes[group.camera]
        width, height = group.lens.width or 2 * values[2], group.lens.height or 2 * values[3]
        root, away = _prior(float(width), float(height), values)
        prior[part, part] = change.T @ root.T @ root @ change
        travel[part] = np.linalg.lstsq(root @ change, root @ away, rcond=None)[0]
        drawn = True
    if not drawn:
        return descent
    started = replace(descent.estimate, travel=travel)
    found = descend(replace(problem, prior=prior), started, weights)
    estimate = replace(found.estimate, travel=descent.estimate.travel)
    there = evaluate(problem, estimate, weights)
    return Descent(estimate, there, normal_equations(problem, estimate, there), found.converged)


def _prior(width: float, height: float, values: Array) -> tuple[Array, Array]:
    """Return what whitens (l, l) how far a lens is from the usual one, and how far `values` (l,) are from that."""
    longer = max(width, height)
    usual = np.array([longer, longer, (width - 1) / 2, (height - 1) / 2, *np.zeros(len(values) - 4)])
    spread = np.array([1.0, 1.0, *[CENTRE * longer] * 2, *[BEND] * (len(values) - 4)])
    root = np.diag(1 / spread)
    root[0, :2] = 0.5 / (FOCAL * longer)
    root[1, :2] = np.array([1, -1]) / (ASPECT * longer)
    return root, values - usual
