"""How sure the fit is of its parameters."""

import numpy as np
from numpy.typing import NDArray

from calib.likelihood.descent import Descent, count_measurements
from calib.likelihood.problem import Problem, Weights

Array = NDArray[np.float64]


def noise_variance(problem: Problem, descent: Descent, weights: Weights) -> float:
    """Return the mean squared misfit of one whitened measurement: 1 where the noise was known and the model holds."""
    freedom = count_measurements(problem, weights) - int(problem.free.sum())
    return descent.evaluation.cost / max(freedom, 1)


def step_covariance(problem: Problem, descent: Descent, variance: float) -> Array:
    """Return the covariance (p, p) of a step of the parameters, zero where they are fixed."""
    return covariance_of(descent.equations.information, problem.free, variance)


def covariance_of(information: Array, free: NDArray[np.bool_], variance: float) -> Array:
    """Return the covariance (p, p) that goes with an `information` (p, p), zero for what is not `free` (p,).

    Directions that the measurements say nothing about are given a variance so large that it cannot be overlooked.
    """
    own = np.ix_(free, free)
    scale = 1 / np.sqrt(np.maximum(np.diag(information)[free], 1e-300))
    values, vectors = np.linalg.eigh(information[own] * np.outer(scale, scale))
    inverse = (vectors / np.maximum(values, 1e-13 * values.max())) @ vectors.T
    covariance = np.zeros_like(information)
    covariance[own] = variance * inverse * np.outer(scale, scale)
    return covariance
