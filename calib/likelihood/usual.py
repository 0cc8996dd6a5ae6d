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
        if values is None or group.lens is None or not problem.free[part].any():
            continue
        width, height = group.lens.width or 2 * values[2], group.lens.height or 2 * values[3]
        prior[part, part], travel[part] = _prior(float(width), float(height), values)
        drawn = True
    if not drawn:
        return descent
    started = replace(descent.estimate, travel=travel)
    found = descend(replace(problem, prior=prior), started, weights)
    estimate = replace(found.estimate, travel=descent.estimate.travel)
    there = evaluate(problem, estimate, weights)
    return Descent(estimate, there, normal_equations(problem, estimate, there), found.converged)


def _prior(width: float, height: float, values: Array) -> tuple[Array, Array]:
    """Return the information (l, l) that draws a lens to the usual one, and how far `values` (l,) are from that."""
    longer = max(width, height)
    usual = np.array([longer, longer, (width - 1) / 2, (height - 1) / 2, *np.zeros(len(values) - 4)])
    mean, difference = np.zeros(len(values)), np.zeros(len(values))
    mean[:2], difference[:2] = 0.5 / (FOCAL * longer), np.array([1, -1]) / (ASPECT * longer)
    information = np.outer(mean, mean) + np.outer(difference, difference)
    spread = np.array([CENTRE * longer] * 2 + [BEND] * (len(values) - 4))
    information[2:, 2:] += np.diag(spread**-2.0)
    return information, values - usual
