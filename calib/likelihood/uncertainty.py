"""How sure the fit is of its parameters."""

import numpy as np
from numpy.typing import NDArray

from calib.likelihood.descent import UNTOLD, Descent, count_measurements
from calib.likelihood.problem import Problem, Weights

Array = NDArray[np.float64]


def noise_variance(problem: Problem, descent: Descent, weights: Weights) -> float:
    """Return the mean squared misfit of one whitened measurement: 1 where the noise was known and the model holds."""
    freedom = count_measurements(problem, weights) - int(problem.free.sum())
    return descent.evaluation.cost / max(freedom, 1)


def step_covariance(problem: Problem, descent: Descent, variance: float) -> Array:
    """Return the covariance (p, p) of a step of the parameters, zero where they are fixed."""
    return covariance_of(problem, descent.equations.information, variance)


def covariance_of(problem: Problem, information: Array, variance: float) -> Array:
    """Return the covariance (p, p) that goes with an `information` (p, p) of the problem's parameters, its prior in it.

    The measurements' noise is of the size that is seen (`variance`); what was known before is as sure as it says.
    Directions that nothing is known about are given a variance so large that it cannot be overlooked.
    """
    own = np.ix_(problem.free, problem.free)
    information = information + (variance - 1) * problem.prior
    sizes = np.diag(information)[problem.free]
    scale = 1 / np.sqrt(np.maximum(sizes, UNTOLD * sizes.max(initial=0.0)))
    values, vectors = np.linalg.eigh(information[own] * np.outer(scale, scale))
    inverse = (vectors / np.maximum(values, 1e-13 * values.max())) @ vectors.T
    covariance = np.zeros_like(information)
    covariance[own] = variance * inverse * np.outer(scale, scale)
    return covariance
