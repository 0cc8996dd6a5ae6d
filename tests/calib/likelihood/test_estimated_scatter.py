"""Which scatter makes made-up misfits most likely, where the likelihood is steep at the start and flat beyond."""

import numpy as np
import pytest
from scipy.optimize import minimize

from calib.likelihood.scatter import GAIN, PoseMisfit, Scatter, estimated_scatter

JOINTS = 6
VIEWS = 18
STARTS = 6


def misfits(rng: np.random.Generator, std: np.ndarray, looseness: float) -> PoseMisfit:
    """Return misfits of views whose readings scatter by `std`, and whose poses `looseness` times as their points do."""
    jacobian = rng.normal(size=(VIEWS, 60, 6)) * np.repeat([1000, 20], 3)
    information = np.swapaxes(jacobian, 1, 2) @ jacobian
    by_reading = rng.normal(size=(VIEWS, 6, JOINTS))
    own = np.linalg.cholesky(np.linalg.inv(information)) @ rng.normal(size=(VIEWS, 6, 1))
    away = np.sqrt(1 + looseness) * own + by_reading @ (std * rng.normal(size=(VIEWS, JOINTS)))[..., None]
    return PoseMisfit(information, -(information @ away)[..., 0], by_reading, loose=True)


def estimated(misfit: PoseMisfit) -> Scatter:
    return estimated_scatter([misfit], np.zeros(JOINTS), np.ones(JOINTS, dtype=bool))


def unlikelihood(misfit: PoseMisfit, variances: np.ndarray) -> float:
    """Return minus twice the log-likelihood, up to a constant."""
    own = np.linalg.inv(misfit.information)
    away = -own @ misfit.gradient[..., None]
    by_reading = misfit.by_reading
    covariance = (1 + variances[-1]) * own + (by_reading * variances[:-1]) @ np.swapaxes(by_reading, 1, 2)
    squares = np.swapaxes(away, 1, 2) @ np.linalg.solve(covariance, away)
    return float(np.linalg.slogdet(covariance)[1].sum() + squares.sum())


def least_unlikelihood(misfit: PoseMisfit, rng: np.random.Generator) -> float:
    """Return the least from several starts, with every part scattering."""
    typical = np.log(np.append(np.full(JOINTS, 1e-6), 10.0))
    return min(
        minimize(
            lambda logarithms: unlikelihood(misfit, np.exp(logarithms)),
            typical + rng.uniform(-3, 3, JOINTS + 1),
            method="L-BFGS-B",
            bounds=[(each - 12, each + 12) for each in typical],
        ).fun
        for _ in range(STARTS)
    )


@pytest.mark.parametrize("seed", [0, 24, 124, 182])
def test_no_other_scatter_is_more_likely(seed: int) -> None:
    """From all but the first, a search over logarithms can lose a part where it is too small to matter."""
    rng = np.random.default_rng(seed)
    misfit = misfits(rng, 10 ** rng.uniform(-3, -2.5, JOINTS), 100)
    found = estimated(misfit)
    variances = np.append(found.readings**2, found.looseness)
    allowed = 0.01 + GAIN * (variances == 0).sum()
    assert unlikelihood(misfit, variances) < least_unlikelihood(misfit, rng) + allowed


def test_readings_a_hundred_thousand_times_as_noisy_as_points() -> None:
    rng = np.random.default_rng(0)
    std = np.full(JOINTS, 100.0)
    found = estimated(misfits(rng, std, 0.0))
    assert found.readings == pytest.approx(std, rel=0.6)
    assert found.looseness == 0


def test_a_part_that_nothing_tells_of_is_none() -> None:
    misfit = misfits(np.random.default_rng(0), np.array([0, 0, 0, 0.01, 0.01, 0.01]), 0.0)
    found = estimated(misfit)
    assert (found.readings[:3] == 0).all()
    assert (found.readings[3:] > 0).all()
    assert found.looseness == 0


def test_two_joints_with_one_axis_share_their_noise() -> None:
    misfit = misfits(np.random.default_rng(0), np.array([0, 0, 0, 0, 0, 0.01]), 0.0)
    misfit.by_reading[..., 4] = misfit.by_reading[..., 5]
    found = estimated(misfit)
    assert np.count_nonzero(found.readings) == 1
    assert found.readings[4:].max() == pytest.approx(0.01, rel=0.6)
