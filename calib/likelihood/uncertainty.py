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
    """Return the covariance (p, p) of a step of the parameters, zero where they are fixed.

    Directions that the measurements say nothing about are given a variance so large that it cannot be overlooked.
    """
    free = np.flatnonzero(problem.free)
    information = descent.equations.information[np.ix_(free, free)]
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    inverse = (vectors / np.maximum(values, 1e-13 * values.max())) @ vectors.T
    covariance = np.zeros((len(problem.free), len(problem.free)))
    covariance[np.ix_(free, free)] = variance * inverse * np.outer(scale, scale)
    return covariance
