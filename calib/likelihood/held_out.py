"""How well each view is predicted by all the others: leave-one-view-out, from the fit's own Jacobian.

Taking a view's information and gradient out of the normal equations and solving them once more is a Newton step to
the fit without it, and the fit is so nearly quadratic there that no second one is needed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.likelihood.measurements import GivenPoses, PointViews
from calib.likelihood.normal import local_by_parameter, without_reading_errors
from calib.likelihood.problem import Estimate, Evaluation, Problem, Weights

Array = NDArray[np.float64]


DETERMINED = 1e-12
"""Ratio of the smallest to the largest eigenvalue of the scaled information below which parameters are undetermined."""


@dataclass(frozen=True)
class HeldOut:
    """A view's error against the fit of the others: rms of its points (px), or of a given pose (m, rad)."""

    view: int
    rms_px: float | None
    position_m: float | None
    rotation_rad: float | None


def held_out(
    problem: Problem,
    estimate: Estimate,
    weights: Weights,
    there: Evaluation,
    as_read: Evaluation,
    information: Array,
) -> list[HeldOut]:
    """Return each view's held-out error, but for those set aside and those without which the fit is undetermined.

    `there` is the fit, `as_read` the same chain with each reading as it was read: a prediction knows no better.
    `information` (p, p) is that of all views.
    """
    free, rests = np.flatnonzero(problem.free), problem.layout.rests
    # How far joints at rest are from what was read is not known to a prediction.
    known = (free < rests.start) | (free >= rests.stop)
    errors: list[HeldOut] = []
    for group, weight, terms, read in zip(
        problem.groups, weights.groups, there.terms, as_read.terms, strict=True
    ):
        local = local_by_parameter(problem, group, terms)
        hessian, slope, _ = without_reading_errors(problem, estimate, group, terms, local)
        ours = local[:, :, free]
        own = np.swapaxes(ours, 1, 2) @ hessian @ ours
        pull = (np.swapaxes(ours, 1, 2) @ slope[..., None])[..., 0]
        steps, determined = _steps_without(information[np.ix_(free, free)], own, pull)
        moved = read.blocks.jacobian @ (ours @ (known * steps)[..., None])
        for row in range(len(own)):
            if not determined[row] or not np.any(weight[row] > 0):
                continue
            errors.append(_error(group.data, row, weight[row], read.blocks.residuals[row], moved[row, :, 0]))
    return errors


def _steps_without(information: Array, own: Array, pull: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the step (n, p) to the fit without each view, and whether the others determine it (n,)."""
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    others = (information - own) * np.outer(scale, scale)
    values = np.linalg.eigvalsh(others)
    determined = values[:, 0] > DETERMINED * values[:, -1]
    steps = np.zeros_like(pull)
    right = (scale * pull[determined])[..., None]
    steps[determined] = scale * np.linalg.solve(others[determined], right)[..., 0]
    return steps, determined


def _error(data: PointViews | GivenPoses, row: int, weight: Array, residual: Array, moved: Array) -> HeldOut:
    if isinstance(data, PointViews):
        whitened = residual + moved.reshape(-1, 2)
        pixels = np.linalg.solve(data.whitening[row], whitened[..., None])[..., 0][weight > 0]
        return HeldOut(int(data.views[row]), float(np.sqrt((pixels**2).sum(axis=1).mean())), None, None)
    away = np.linalg.solve(data.whitening, residual[:, 0] + moved / np.sqrt(weight))
    position, rotation = float(np.linalg.norm(away[3:])), float(np.linalg.norm(away[:3]))
    return HeldOut(int(data.views[row]), None, position, rotation)
