"""From wherever it starts, within reason: the same end, never a worse one, and every parameter moves."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.random_rigs import POINTS, looking_rig, noisy_session
from calib.first_solution import camera_views, first_solution
from calib.likelihood.building import Start, built
from calib.likelihood.descent import descend
from calib.likelihood.problem import all_in, evaluate, offsets_at
from calib.likelihood.refinement import Refined, refine
from calib.observations import Observation, observe
from calib.session import Session
from calib.transforms import inverse, rotation_log
from calib.twists import exp_twist

RIGS = range(6)
SAME = 0.1
"""Standard deviations by which two ends may differ and be the same."""


@cache
def problem(seed: int) -> tuple[Session, list[Observation], Start, Refined]:
    """Return a session, its observations, the closed form's start, and the fit from there."""
    rng = np.random.default_rng(seed)
    session = noisy_session(looking_rig(rng, 2 + seed % 3), rng)
    observations = observe(session).observations
    found = first_solution(session, observations, camera_views(session, observations))
    assert found.mounts is not None
    start = Start(found.chain, found.mounts, found.lenses)
    return session, observations, start, refine(session, observations, start)


def unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def thrown(start: Start, rng: np.random.Generator, size: float = 1.0) -> Start:
    """Return a start off by `size` times 5 degrees in directions, a tenth of the distance in places, 20 % in scales."""
    distance = float(np.linalg.norm(start.mounts[0, :3, 3] - POINTS.mean(axis=0)))
    chain, angle, away = start.chain, np.radians(5) * size, 0.1 * size * distance
    sideways = [unit(np.cross(axis, rng.normal(size=3))) for axis in chain.axes]
    shifts = [away * unit(np.cross(axis, rng.normal(size=3))) for axis in chain.axes]
    factors = 1 + 0.2 * size * rng.choice([-1, 1], (len(chain) + 2))
    turns = [
        np.append(angle * unit(rng.normal(size=3)), away * unit(rng.normal(size=3))) for _ in start.mounts
    ]
    lens = start.lenses[0]
    assert lens is not None
    return Start(
        chain=replace(
            chain,
            axes=np.cos(angle) * chain.axes + np.sin(angle) * np.array(sideways),
            points=chain.points + shifts,
            scales=chain.scales * factors[2:],
        ),
        mounts=start.mounts @ exp_twist(np.array(turns)),
        lenses=[lens.model_copy(update={"fx": lens.fx * factors[0], "fy": lens.fy * factors[1]})],
    )


def apart(one: Refined, other: Refined) -> float:
    """Return the largest difference of the camera's pose in any view, in standard deviations."""
    terms = one.descent.evaluation.terms[0].chain
    away = inverse(terms.poses) @ other.descent.evaluation.terms[0].chain.poses
    twists = np.concatenate([rotation_log(away), away[:, :3, 3]], axis=1)
    covariance = terms.by_parameter @ one.covariance @ np.swapaxes(terms.by_parameter, 1, 2)
    return float(np.abs(twists / np.sqrt(np.einsum("nii->ni", covariance))).max())


@pytest.mark.parametrize("seed", RIGS)
def test_a_start_thrown_off_the_closed_form_ends_at_the_same_place(seed: int) -> None:
    session, observations, start, fit = problem(seed)
    rng = np.random.default_rng(seed)
    for _ in range(2):
        assert apart(fit, refine(session, observations, thrown(start, rng))) < SAME


@pytest.mark.parametrize("size", [0.1, 1, 3])
def test_no_way_down_ends_higher_than_it_began(size: float) -> None:
    for seed in RIGS:
        session, observations, start, _ = problem(seed)
        likelihood, estimate = built(session, observations, thrown(start, np.random.default_rng(seed), size))
        everything = all_in(likelihood)
        descent = descend(likelihood, estimate, everything)
        assert descent.evaluation.cost <= evaluate(likelihood, estimate, everything).cost
        assert descent.evaluation.cost == evaluate(likelihood, descent.estimate, everything).cost


@pytest.mark.parametrize("seed", RIGS)
def test_the_fit_is_likelier_than_its_start(seed: int) -> None:
    session, observations, start, fit = problem(seed)
    off = thrown(start, np.random.default_rng(seed))
    _, estimate = built(session, observations, off)
    began = replace(estimate, offsets=offsets_at(fit.problem, estimate))
    assert fit.descent.evaluation.cost < evaluate(fit.problem, began, fit.weights).cost


def test_every_free_parameter_comes_back_from_where_it_is_moved() -> None:
    _, _, _, fit = problem(1)
    likelihood, estimate = fit.problem, fit.descent.estimate
    layout, deviations = likelihood.layout, np.sqrt(np.diag(fit.covariance))
    assert likelihood.free.all()
    for place, name in enumerate(layout.names):
        step = 20 * deviations * (np.arange(len(layout)) == place)
        moved = replace(estimate, state=estimate.state.moved(step, layout), travel=estimate.travel + step)
        back = descend(likelihood, moved, fit.weights).estimate.travel - estimate.travel
        assert np.abs(back / deviations).max() < SAME, name
