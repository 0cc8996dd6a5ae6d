"""What the views do not tell is named, nothing else is, and the advice that is given helps as much as it says."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.random_rigs import looking_rig, noisy_session
from calib import solve
from calib.first_solution import camera_views, first_solution
from calib.likelihood.building import Start, built
from calib.likelihood.other_views import Sweep, Tilt, information_of, other_views
from calib.likelihood.quantities import Quantity, quantities
from calib.likelihood.refinement import Refined, refine
from calib.likelihood.state import State
from calib.likelihood.usual import usual_rig
from calib.likelihood.weakness import Weakness, weaknesses
from calib.most_likely import most_likely
from calib.observations import observe
from calib.session import Session
from calib.transforms import inverse
from tests.calib.likelihood.weak_rigs import (
    CENTRE,
    advised,
    pan_and_tilt,
    seen,
    slide_along_the_line_of_sight,
    slide_and_pan,
)

WEAK = {
    "a pan before a parallel plate": slide_and_pan(),
    "pan and tilt before a parallel plate": pan_and_tilt(0, 5, 5),
    "a pan that hardly moves": pan_and_tilt(23, 0.5, 5),
    "two joints that hardly move": pan_and_tilt(15, 2, 2),
}


def refined(session: Session) -> Refined:
    observations = observe(session).observations
    start = first_solution(session, observations, camera_views(session, observations))
    assert start.mounts is not None
    return refine(session, observations, Start(start.chain, start.mounts, start.lenses))


def asked(session: Session, fit: Refined) -> dict[tuple[str, str], Quantity]:
    names = [joint.name for joint in session.joints]
    found = quantities(fit.problem, fit.state, names, ["main"], CENTRE)
    return {(one.kind, one.owner): one for one in found}


@cache
def weak_fit(name: str) -> tuple[Session, Refined, list[Weakness]]:
    session = seen(WEAK[name], WEAK[name].plan(), seed=0)
    fit = refined(session)
    return session, fit, weaknesses(session, fit)


@pytest.mark.parametrize("seed", range(6))
def test_quantities_change_with_the_parameters_as_they_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    session = noisy_session(looking_rig(rng, 3), rng)
    observations = observe(session).observations
    start = first_solution(session, observations, camera_views(session, observations))
    assert start.mounts is not None
    problem, estimate = built(session, observations, Start(start.chain, start.mounts, start.lenses))
    readings = session.readings()
    amid = (readings.min(axis=0) + readings.max(axis=0)) / 2
    names = [joint.name for joint in session.joints]
    step = 1e-6 * rng.normal(size=len(problem.layout))
    moved = estimate.state.moved(step, problem.layout)
    lens = estimate.state.lenses[0]
    assert lens is not None
    for one in quantities(problem, estimate.state, names, ["main"], CENTRE):
        said = float(np.linalg.norm(one.rows @ step) * one.tolerance)
        before, after = (
            _measured(one, state, names, amid, lens[:2].mean()) for state in (estimate.state, moved)
        )
        change = after - before
        if one.kind == "place":
            axis = _axis(estimate.state, names.index(one.owner), amid)[0]
            change = change - (change @ axis) * axis
        assert np.linalg.norm(change) == pytest.approx(said, rel=1e-3, abs=1e-12), (one.owner, one.kind)


def _measured(one: Quantity, state: State, names: list[str], amid: np.ndarray, focal: float) -> np.ndarray:
    """Return a quantity's numbers by the chain's forward model alone."""
    pose = state.chain.poses(amid, len(names), state.mounts[0])
    lens = state.lenses[0]
    assert lens is not None
    match one.kind:
        case "scale":
            return np.log(state.chain.scales[[names.index(one.owner)]])
        case "focal_length":
            return lens[:2] / focal
        case "principal_point":
            return lens[2:4] / focal
        case "stand":
            return pose[:3, 3]
        case "look":
            # Turning by a small angle moves the matrix by sqrt(2) times that.
            return pose[:3, :3].ravel() / np.sqrt(2)
        case "direction":
            return _axis(state, names.index(one.owner), amid)[0]
        case _:
            return _axis(state, names.index(one.owner), amid)[1]


def _axis(state: State, joint: int, amid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a joint's axis in the camera's frame, and its point nearest the camera."""
    pose = state.chain.poses(amid, len(state.chain), state.mounts[0])
    frame = inverse(pose) @ state.chain.displacement(amid, joint)
    axis = frame[:3, :3] @ state.chain.axes[joint]
    point = frame[:3, :3] @ state.chain.points[joint] + frame[:3, 3]
    return axis, point - (point @ axis) * axis


@pytest.mark.parametrize("seed", range(9))
def test_nothing_is_said_of_a_rig_that_is_looked_at_well(seed: int) -> None:
    rng = np.random.default_rng(seed)
    session = noisy_session(looking_rig(rng, 2 + seed % 3), rng)
    assert weaknesses(session, refined(session)) == []


def test_a_slide_along_the_line_of_sight_hides_the_focal_length() -> None:
    looking = slide_along_the_line_of_sight()
    session = seen(looking, looking.plan(), seed=0)
    warnings = solve(session).quality.warnings
    assert len(warnings) == 1
    assert "can't be told apart: tilting the target by " in warnings[0]
    assert "j0's scale" in warnings[0]
    assert "the focal length of main" in warnings[0]


def test_known_intrinsics_tell_them_apart() -> None:
    looking = slide_along_the_line_of_sight()
    numbers = dict(zip(["fx", "fy", "cx", "cy"], looking.lens[:4].tolist(), strict=True))
    lens = {"model": "opencv", "distortion": looking.lens[4:].tolist(), **numbers}
    document = seen(looking, looking.plan(), seed=0).model_dump(exclude_unset=True)
    document["cameras"][0]["intrinsics"] = lens
    assert solve(Session.model_validate(document)).quality.warnings == []


@pytest.mark.parametrize("name", WEAK)
def test_what_is_weak_is_named(name: str) -> None:
    _, _, found = weak_fit(name)
    assert found
    worst = found[0].known[0]
    assert (worst.quantity.kind, worst.quantity.owner) == ("place", "j1" if "a pan before" in name else "j0")
    assert worst.std > 1
    assert not found[0].undetermined


@pytest.mark.parametrize("name", WEAK)
def test_following_the_advice_brings_what_it_says(name: str) -> None:
    """The worst known of a weakness, in a session taken as advised, is as much better known as was predicted."""
    _, _, found = weak_fit(name)
    for weakness in found:
        assert weakness.advice is not None
        looking, plan = advised(WEAK[name], WEAK[name].plan(), weakness.advice.change)
        session = seen(looking, plan, seed=1)
        fit = refined(session)
        there = asked(session, fit)
        after = [
            there[one.quantity.kind, one.quantity.owner].std(fit.covariance)
            * there[one.quantity.kind, one.quantity.owner].tolerance
            / one.quantity.tolerance
            for one in weakness.known
        ]
        assert weakness.known[0].std / max(after) == pytest.approx(weakness.advice.gain, rel=0.3)


def test_most_likely_tells_what_is_weak() -> None:
    session, _, found = weak_fit("pan and tilt before a parallel plate")
    observations = observe(session).observations
    solution = most_likely(
        session, observations, first_solution(session, observations, camera_views(session, observations))
    )
    assert [len(one.known) for one in solution.weaknesses] == [len(one.known) for one in found]
    sentences = solve(session).quality.warnings
    assert len(sentences) == len(found)
    assert "times better known" in sentences[0]


def test_nothing_is_advised_that_the_camera_could_not_see() -> None:
    """A plate is not leaned beyond what is found, nor the camera turned away from it."""
    looking = pan_and_tilt(40, 2, 2)
    session = seen(looking, looking.plan(), seed=0)
    fit = refined(session)
    offered = {
        others.change: information_of(others, session, fit.problem, fit.descent.estimate)
        for others in other_views(session, fit.problem, fit.state)
    }
    leaning = {
        change.degrees for change, told in offered.items() if isinstance(change, Tilt) and told is not None
    }
    about_y = [change for change in offered if isinstance(change, Tilt) and change.axis == "Y"]
    assert leaning
    assert [offered[change] is None for change in about_y].count(True) == 1
    wide = Sweep("j0", -4.0, 4.0)
    assert offered[wide] is not None
    far = next(o for o in other_views(session, fit.problem, fit.state) if o.change == wide)
    behind = replace(far, readings=far.readings + np.array([180.0, 0.0]))
    assert information_of(behind, session, fit.problem, fit.descent.estimate) is None


def test_a_lens_that_the_views_tell_stays_as_they_have_it() -> None:
    """What is usual weighs less than a tenth of a standard deviation where the views tell better."""
    rng = np.random.default_rng(4)
    session = noisy_session(looking_rig(rng, 3), rng)
    fit = refined(session)
    usual = usual_rig(fit.problem, fit.descent, fit.weights).estimate.state.lenses[0]
    found, part = fit.state.lenses[0], fit.problem.layout.lenses[0]
    assert usual is not None
    assert found is not None
    std = np.sqrt(np.diag(fit.covariance)[part])
    assert np.all(np.abs(usual - found)[:4] < 0.1 * std[:4])
