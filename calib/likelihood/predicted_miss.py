"""How far points should lie from where they are predicted, by all that the fit knows to be uncertain."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from calib.likelihood.measurements import PointViews
from calib.likelihood.normal import local_by_parameter
from calib.likelihood.problem import Evaluation, Problem, Weights

Array = NDArray[np.float64]


def predicted_miss(
    problem: Problem, weights: Weights, evaluation: Evaluation, covariance: Array
) -> float | None:
    """Return by how much points should be missed (rms, px) in views like the fit's; None where there are no points.

    That is by their own noise, by what the parameters' `covariance` (p, p) leaves unknown, and by the noise of the
    readings that a prediction is made from. What scatters the views beyond these is not in the model, and not in here.
    """
    factor = _factor(covariance)
    squares, count = 0.0, 0
    for group, weight, terms in zip(problem.groups, weights.groups, evaluation.terms, strict=True):
        if not isinstance(group.data, PointViews):
            continue
        local = local_by_parameter(problem, group, terms) @ factor
        by_reading = np.zeros((*local.shape[:2], len(problem.reading_std)))
        by_reading[:, :6] = terms.chain.by_reading * problem.reading_std
        whitened = terms.blocks.jacobian @ np.concatenate([local, by_reading], axis=2)
        size = (*weight.shape, 2, -1)
        # Noise itself is whitened to one.
        whitened = np.concatenate(
            [whitened.reshape(size), np.broadcast_to(np.eye(2), (*size[:3], 2))], axis=3
        )
        pixels = np.linalg.solve(group.data.whitening, whitened)
        squares += float(np.square(pixels)[weight > 0].sum())
        count += int((weight > 0).sum())
    return sqrt(squares / count) if count else None


def _factor(covariance: Array) -> Array:
    """Return a matrix (p, r) that times its transpose is `covariance` (p, p)."""
    values, vectors = np.linalg.eigh(covariance)
    kept = values > 0
    return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))
