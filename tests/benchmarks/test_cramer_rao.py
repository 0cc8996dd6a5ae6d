"""The bound that efficiency is judged by: two ways to it, which share no formula, come to the same."""

import numpy as np
import pytest

from benchmarks.cramer_rao import pose_bound
from benchmarks.random_rigs import looking_rig, noisy_session
from calib import solve


@pytest.mark.parametrize("joints", [2, 4])
def test_the_fit_claims_the_bound(joints: int) -> None:
    """By differences of the simulator, or by the solver's derivatives and the noise that it found."""
    rng = np.random.default_rng(joints)
    looking = looking_rig(rng, joints)
    readings = looking.readings(rng, 5)
    claimed = solve(noisy_session(looking, rng, 0.1)).pose_covariance(readings)
    assert claimed is not None
    bound = pose_bound(looking, readings, 0.1)
    whitened = np.linalg.solve(bound, claimed)
    # The noise is known from some thousand residuals, the place where it is linearised from the fit.
    assert np.linalg.eigvals(whitened) == pytest.approx(1, rel=0.15)
    assert np.allclose(pose_bound(looking, readings, 0.2), 4 * bound)
