"""What scatters views about their chain: noisy readings, bending arms, and joints that should have stood still."""

import numpy as np
import pytest

from benchmarks.random_rigs import LookingRig, looking_rig, noisy_session, session_of_views
from calib import Calibration, solve
from calib.first_solution import camera_views, first_solution
from calib.likelihood.building import Start
from calib.likelihood.refinement import Refined, refine
from calib.observations import observe
from calib.session import Session
from calib.transforms import inverse, rotation_log
from calib.twists import exp_twist

NOISE = 0.1
BEND = np.array([3e-4] * 3 + [2e-4] * 3)
"""Standard deviations (rad, m) of what an arm bends anew in every view, in the camera's frame."""
SEEDS = range(6)


def refined(session: Session) -> Refined:
    observations = observe(session).observations
    start = first_solution(session, observations, camera_views(session, observations))
    assert start.mounts is not None
    return refine(session, observations, Start(start.chain, start.mounts, start.lenses))


def bending_session(looking: LookingRig, rng: np.random.Generator) -> Session:
    """Return a session of an arm that bends anew in every view."""
    plan = looking.plan()
    readings = np.array([at for _, at in plan])
    poses = looking.rig.poses(readings) @ exp_twist(BEND * rng.normal(size=(len(plan), 6)))
    pixels = looking.seen_from(poses)
    return session_of_views(looking, plan, pixels + NOISE * rng.normal(size=pixels.shape))


def distances(calibration: Calibration, looking: LookingRig, seed: int) -> np.ndarray:
    """Return squared errors of poses over their claimed covariances (n,), at readings all over the range."""
    readings = looking.readings(np.random.default_rng(seed), 40)
    away = inverse(calibration.world_from_camera(readings)) @ looking.rig.poses(readings)
    twists = np.concatenate([rotation_log(away), away[:, :3, 3]], axis=1)
    covariance = calibration.pose_covariance(readings)
    assert covariance is not None
    return (twists * np.linalg.solve(covariance, twists[..., None])[..., 0]).sum(axis=1)


def test_a_bending_arm_is_less_sure_than_its_pictures() -> None:
    found = []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        looking = looking_rig(rng, 2)
        session = bending_session(looking, rng)
        assert refined(session).problem.looseness > 1
        found.append(distances(solve(session), looking, seed).mean() / 6)
    # About ten independent errors a rig; pictures alone would claim a tenth of the true variance.
    assert np.mean(found) == pytest.approx(1, abs=4 * np.sqrt(2 / 60))


def test_a_stiff_arm_is_as_good_as_its_pictures() -> None:
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        looking = looking_rig(rng, 2)
        problem = refined(noisy_session(looking, rng, NOISE)).problem
        assert problem.looseness == 0
        assert (problem.reading_std == 0).all()


def test_noise_of_readings_is_not_taken_for_bending() -> None:
    rng = np.random.default_rng(3)
    looking = looking_rig(rng, 2)
    session = noisy_session(looking, rng, NOISE)
    std = 0.002 * np.ptp(looking.ranges, axis=1)
    views = [
        view.model_copy(update={"readings": (np.array(view.readings) + std * rng.normal(size=2)).tolist()})
        for view in session.views
    ]
    problem = refined(session.with_views(views)).problem
    assert problem.reading_std == pytest.approx(std, rel=0.6)
    assert problem.looseness < 5


@pytest.mark.parametrize("follows", [True, False])
def test_an_idle_joint_is_at_rest_unless_the_views_follow_its_jitter(follows: bool) -> None:
    rng = np.random.default_rng(1)
    looking = looking_rig(rng, 3)
    plan = looking.plan()
    at_rest = np.array([at for _, at in plan])
    jitter = 0.002 * np.ptp(looking.ranges, axis=1) * rng.normal(size=at_rest.shape)
    jitter[np.arange(len(plan)), [joint for joint, _ in plan]] = 0
    pixels = looking.pixels(at_rest + jitter if follows else at_rest)
    read = [(joint, at) for (joint, _), at in zip(plan, at_rest + jitter, strict=True)]
    session = session_of_views(looking, read, pixels + NOISE * rng.normal(size=pixels.shape))
    problem = refined(session).problem
    same = (problem.readings == session.readings()).all(axis=0)
    assert same.all() if follows else not same.any()
    if follows:
        # Then nothing is left that could be noise.
        assert problem.looseness == 0
        assert (problem.reading_std == 0).all()


@pytest.mark.parametrize("stated", [True, False])
def test_a_joint_at_rest_is_off_by_the_same_in_every_view(stated: bool) -> None:
    """Its reading is one draw of the noise, however often it was read: claims must not shrink with the views."""
    found = []
    for seed in (0, 1, 2, 3, 4, 6, 7, 8):
        # At 5 both joints slide: then the lens is hardly told, and no covariance would do.
        rng = np.random.default_rng(seed)
        looking = looking_rig(rng, 2)
        session = noisy_session(looking, rng, NOISE)
        std = 0.001 * np.ptp(looking.ranges, axis=1)
        plan = looking.plan()
        errors = std * rng.normal(size=(len(plan), 2))
        for joint in range(2):
            # While one joint moves, the other does not.
            views = [row for row, (moved, _) in enumerate(plan) if moved == joint]
            errors[views, 1 - joint] = errors[views[0], 1 - joint]
        views = [
            view.model_copy(update={"readings": (np.array(view.readings) + error).tolist()})
            for view, error in zip(session.views, errors, strict=True)
        ]
        joints = [
            joint.model_copy(update={"reading_std": float(own)})
            for joint, own in zip(session.joints, std, strict=True)
        ]
        session = session.with_views(views).model_copy(update={"joints": joints} if stated else {})
        found.append(distances(solve(session), looking, seed).mean() / 6)
    # As many independent errors as rigs and idle joints: a mean of all views' would be 3 and more.
    assert 0.4 < np.mean(found) < 1.8
