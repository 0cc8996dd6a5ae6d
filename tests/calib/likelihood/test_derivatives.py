"""Every derivative of the likelihood, against differences of the functions themselves."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.random_rigs import looking_rig, noisy_session
from calib.chain import Chain
from calib.corrections import Coupling, OncePerTurn
from calib.first_solution import camera_views, first_solution
from calib.lens import project_points
from calib.likelihood.blocks import pose_blocks, pose_residuals
from calib.likelihood.building import Start, built
from calib.likelihood.chain_terms import chain_terms
from calib.likelihood.document_covariance import document_jacobian
from calib.likelihood.imperfections import Circumstances, Imperfections, Play, with_imperfections
from calib.likelihood.lens_terms import lens_from_vector, lens_vector, pixel_terms
from calib.likelihood.measurements import GivenPoses
from calib.likelihood.normal import normal_equations
from calib.likelihood.problem import Estimate, all_in, evaluate
from calib.likelihood.state import Layout, State
from calib.observations import observe
from calib.session import Intrinsics
from calib.transforms import inverse, rotation_log
from calib.twists import exp_twist
from tests.calib.rigs import random_rig

RNG = np.random.default_rng(0)
LENSES = [
    Intrinsics(model="opencv", fx=800, fy=810, cx=320, cy=240, distortion=[-0.26, 0.1, 1e-3, -5e-4, 0.02]),
    Intrinsics(model="division", fx=800, fy=810, cx=320, cy=240, distortion=[-0.2]),
]
STEP = 1e-6
PATHS = [
    "corrections.backlash.0.half_gap",
    "corrections.once_per_turn.0.sine",
    "corrections.target_warp.heights.0",
    "corrections.target_warp.heights.1",
]


@pytest.mark.parametrize("lens", LENSES, ids=["opencv", "division"])
def test_pixels_by_point_and_lens(lens: Intrinsics) -> None:
    points = np.column_stack([RNG.uniform(-0.5, 0.5, (30, 2)), RNG.uniform(1, 2, 30)])
    values = lens_vector(lens)
    pixels, by_point, by_lens = pixel_terms(points.T, values, lens.model)
    assert np.allclose(pixels.T, project_points(points, lens), atol=1e-12)
    for k, step in enumerate(STEP * np.eye(3)):
        difference = project_points(points + step, lens) - project_points(points - step, lens)
        assert np.allclose(by_point[:, k].T, difference / (2 * STEP), rtol=1e-6, atol=1e-4)
    for k, step in enumerate(STEP * np.eye(len(values))):
        there = project_points(points, lens_from_vector(values + step, lens))
        back = project_points(points, lens_from_vector(values - step, lens))
        assert np.allclose(by_lens[:, k].T, (there - back) / (2 * STEP), rtol=1e-5, atol=1e-5)


def some_state() -> tuple[State, Layout, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    rig = random_rig(rng, ["revolute", "prismatic", "revolute"], ["skew", "parallel"])
    chain = Chain.of(rig.kinds, rig.axes, rig.points, rig.scales)
    lens = lens_vector(LENSES[0])
    state = State(chain, rig.mount[None], (lens,), np.array([1e-4, -2e-4]), np.array([3e-4, -2e-4]))
    corrections, warp = ["backlash", "eccentricity"], ["xx", "xy"]
    layout = Layout.of(state, ["a", "b", "c"], ["main"], ["opencv"], corrections, warp)
    readings = rng.uniform(-1, 1, (6, 3)) / rig.scales
    return state, layout, readings, rng.normal(size=(6, 3, 2))


def body_difference(there: np.ndarray, back: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the twists in the camera's frame per step between poses on both sides of `at`."""

    def away(poses: np.ndarray) -> np.ndarray:
        motion = inverse(at) @ poses
        return np.concatenate([rotation_log(motion), motion[:, :3, 3]], axis=1)

    return (away(there) - away(back)) / (2 * STEP)


def test_poses_by_every_parameter() -> None:
    state, layout, readings, regressors = some_state()
    terms = chain_terms(state, layout, 0, 3, readings, regressors)
    for k, step in enumerate(STEP * np.eye(len(layout))):
        there = chain_terms(state.moved(step, layout), layout, 0, 3, readings, regressors).poses
        back = chain_terms(state.moved(-step, layout), layout, 0, 3, readings, regressors).poses
        expected = body_difference(there, back, terms.poses)
        assert np.allclose(terms.by_parameter[:, :, k], expected, rtol=1e-6, atol=1e-7), layout.names[k]


def test_poses_by_every_reading() -> None:
    state, layout, readings, regressors = some_state()
    terms = chain_terms(state, layout, 0, 3, readings, regressors)
    for joint, scale in enumerate(state.chain.scales):
        step = STEP * np.eye(3)[joint]
        there = chain_terms(state, layout, 0, 3, readings + step / scale, regressors).poses
        back = chain_terms(state, layout, 0, 3, readings - step / scale, regressors).poses
        expected = body_difference(there, back, terms.poses) * scale
        assert np.allclose(terms.by_reading[:, :, joint], expected, rtol=1e-6, atol=1e-7)


def test_given_poses_by_the_camera() -> None:
    measured = exp_twist(RNG.normal(size=(5, 6)))
    predicted = measured @ exp_twist(1e-9 * RNG.normal(size=(5, 6)))
    _, jacobian = pose_residuals(measured, predicted)
    for k, step in enumerate(STEP * np.eye(6)):
        there, _ = pose_residuals(measured, predicted @ exp_twist(step))
        back, _ = pose_residuals(measured, predicted @ exp_twist(-step))
        assert np.allclose(jacobian[..., k], (there - back) / (2 * STEP), atol=1e-6)


def test_given_poses_by_their_sensors_aspect() -> None:
    measured = exp_twist(RNG.normal(size=(5, 6)))
    given = GivenPoses(np.arange(5), measured, np.diag(np.arange(1.0, 7)))
    aspects, own, weights = np.array([0.1, -0.2]), np.array([0.0, 1.0]), np.full((5, 6), 0.5)
    predicted = measured @ exp_twist(0.1 * RNG.normal(size=(5, 6)))
    blocks = pose_blocks(given, predicted, weights, own, aspects)
    for k, step in enumerate(STEP * np.eye(2)):
        there = pose_blocks(given, predicted, weights, own, aspects + step).residuals
        back = pose_blocks(given, predicted, weights, own, aspects - step).residuals
        expected = np.sqrt(0.5) * (there - back)[..., 0] / (2 * STEP)
        assert np.allclose(blocks.jacobian[:, :, 6 + k], expected, atol=1e-6)


def document_numbers(state: State) -> dict[str, float]:
    """Return the document's numbers of a state, as the calibration states them."""
    numbers: dict[str, float] = {}
    for joint, revolute in enumerate(state.chain.revolute):
        axis, point = state.chain.axes[joint], state.chain.points[joint]
        point = point - (point @ axis) * axis if revolute else state.mounts[0, :3, 3]
        for i in range(3):
            numbers[f"joints.{joint}.axis.{i}"], numbers[f"joints.{joint}.point.{i}"] = axis[i], point[i]
        numbers[f"joints.{joint}.scale"] = state.chain.scales[joint]
    for row in range(3):
        for column in range(4):
            numbers[f"cameras.0.world_from_camera.{row}.{column}"] = state.mounts[0, row, column]
    lens = state.lenses[0]
    assert lens is not None
    for name, value in zip(["fx", "fy", "cx", "cy"], lens[:4], strict=True):
        numbers[f"cameras.0.intrinsics.{name}"] = value
    for i, value in enumerate(lens[4:]):
        numbers[f"cameras.0.intrinsics.distortion.{i}"] = value
    return numbers | dict(zip(PATHS, [*state.corrections, *state.warp], strict=True))


def test_document_by_every_parameter() -> None:
    state, layout, _, _ = some_state()
    where = {path: layout.corrections.start + k for k, path in enumerate(PATHS)}
    names, jacobian = document_jacobian(state, layout, ["opencv"], where)
    assert set(names) == set(document_numbers(state))
    for k, step in enumerate(STEP * np.eye(len(layout))):
        there, back = (
            document_numbers(state.moved(step, layout)),
            document_numbers(state.moved(-step, layout)),
        )
        expected = np.array([(there[name] - back[name]) / (2 * STEP) for name in names])
        assert np.allclose(jacobian[:, k], expected, rtol=1e-5, atol=1e-6), layout.names[k]


def test_a_finite_twist_is_the_matrix_exponential() -> None:
    from scipy.linalg import expm

    for size in (0.0, 1e-9, 1e-4, 0.3, 3.0):
        twist = size * RNG.normal(size=6)
        generator = np.zeros((4, 4))
        generator[:3, :3] = np.cross(np.eye(3), twist[:3])
        generator[:3, 3] = twist[3:]
        assert np.allclose(exp_twist(twist), expm(generator), atol=1e-14)


def test_the_gradient_is_that_of_the_likelihood() -> None:
    """Of every parameter, the corrections' coefficients and the warp's heights among them."""
    session = noisy_session(looking_rig(np.random.default_rng(0), 3), np.random.default_rng(1))
    sides = np.where(RNG.uniform(size=(len(session.views), 3)) < 0.5, -1.0, 1.0)
    found = observe(session).observations
    first = first_solution(session, found, camera_views(session, found))
    assert first.mounts is not None
    about = replace(Circumstances.of(session), sides=sides)
    wanted = Imperfections((Play(0, ((1, 2),)), OncePerTurn(1, 350.0), Coupling(2, 0)), ("xx", "xy", "yyy"))
    start = built(session, found, Start(first.chain, first.mounts, first.lenses))
    problem, estimate = with_imperfections(*start, about, Imperfections(), wanted)
    weights, size = all_in(problem), len(problem.layout)

    def moved(step: np.ndarray) -> Estimate:
        return replace(estimate, state=estimate.state.moved(step, problem.layout))

    away = np.zeros(size)
    away[problem.layout.corrections.start :] = 1e-3 * RNG.normal(size=8)
    estimate = moved(away)
    equations = normal_equations(problem, estimate, evaluate(problem, estimate, weights))
    for k, unit in enumerate(np.eye(size)):
        step = 1e-4 / np.sqrt(equations.information[k, k]) * unit
        costs = [evaluate(problem, moved(sign * step), weights).cost for sign in (1, -1)]
        difference = (costs[0] - costs[1]) / (4 * step[k])
        assert equations.gradient[k] == pytest.approx(difference, rel=1e-4), problem.layout.names[k]
