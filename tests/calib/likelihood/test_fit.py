"""What the maximum-likelihood fit is worth: its error, what it says of it, and what it does with bad measurements."""

from functools import cache

import numpy as np
import pytest

from benchmarks.random_rigs import LookingRig, looking_rig, noisy_session
from calib import Calibration, solve
from calib.session import Session
from calib.transforms import inverse, rotation_log

RIGS = 10


@cache
def rig_and_session(seed: int) -> tuple[LookingRig, Session]:
    rng = np.random.default_rng(seed)
    looking = looking_rig(rng, 2 + seed % 3)
    return looking, noisy_session(looking, rng)


@cache
def most_likely(seed: int) -> Calibration:
    return solve(rig_and_session(seed)[1])


def errors(calibration: Calibration, looking: LookingRig, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the twists from found to true poses (n, 6), and the covariances claimed for them (n, 6, 6)."""
    readings = looking.readings(np.random.default_rng(seed), 40)
    away = inverse(calibration.world_from_camera(readings)) @ looking.rig.poses(readings)
    covariance = calibration.pose_covariance(readings)
    assert covariance is not None
    return np.concatenate([rotation_log(away), away[:, :3, 3]], axis=1), covariance


def test_errors_are_as_large_as_claimed() -> None:
    """Over rigs, the squared error over its claimed covariance is 1 a dimension, and 95 % ellipsoids hold 95 %."""
    distances = []
    for seed in range(RIGS):
        twists, covariances = errors(most_likely(seed), rig_and_session(seed)[0], seed)
        solved = np.linalg.solve(covariances, twists[..., None])[..., 0]
        distances.append((twists * solved).sum(axis=1))
    # Errors within a rig go together: about ten independent ones a rig.
    assert np.mean(distances) / 6 == pytest.approx(1, abs=4 * np.sqrt(2 / 6 / RIGS))
    assert np.mean(np.array(distances) < 12.59) > 0.85


def test_a_rig_of_which_the_views_tell_little_is_followed_to_the_end() -> None:
    """Its focal length is known to 4 % only: the way down from the closed form takes hundreds of steps."""
    twists, covariances = errors(most_likely(147), rig_and_session(147)[0], 147)
    distances = (twists * np.linalg.solve(covariances, twists[..., None])[..., 0]).sum(axis=1)
    assert np.mean(distances) < 12.59


def test_it_beats_the_closed_form_by_far() -> None:
    ratios = []
    for seed in range(RIGS):
        looking, session = rig_and_session(seed)
        readings = looking.readings(np.random.default_rng(seed), 40)
        true = looking.rig.poses(readings)
        miss = [
            np.linalg.norm((c.world_from_camera(readings) - true)[:, :3, 3], axis=1).mean()
            for c in (solve(session, "closed_form"), most_likely(seed))
        ]
        ratios.append(miss[0] / miss[1])
    assert np.median(ratios) > 2


def changed(session: Session, seed: int, what: str) -> tuple[Session, set[int]]:
    """Return the session with a tenth of its views, or of each view's points, made wrong, and which views these are."""
    rng = np.random.default_rng(100 + seed)
    document = session.model_dump(exclude_unset=True)
    views = document["views"]
    if what == "points":
        for view in views:
            pixels = np.array(view["points"]["pixels"])
            wrong = rng.choice(len(pixels), len(pixels) // 10, replace=False)
            angle = rng.uniform(0, 2 * np.pi, len(wrong))
            pixels[wrong] += 5 * np.column_stack([np.cos(angle), np.sin(angle)])
            view["points"]["pixels"] = pixels.tolist()
        return Session.model_validate(document), set(range(len(views)))
    wrong = {int(index) for index in rng.choice(len(views), len(views) // 10, replace=False)}
    span = np.ptp(session.readings(), axis=0)
    for index in wrong:
        joint = session.joint_index(views[index]["joint"])
        views[index]["readings"][joint] += float(rng.choice([-1, 1]) * span[joint] * rng.uniform(0.05, 0.2))
    return Session.model_validate(document), wrong


@pytest.mark.parametrize("what", ["readings", "points"])
@pytest.mark.parametrize("seed", [0, 1, 4])
def test_what_is_wrong_is_named_and_changes_little(seed: int, what: str) -> None:
    looking, session = rig_and_session(seed)
    spoilt, wrong = changed(session, seed, what)
    calibration = solve(spoilt)
    aside = [sentence for sentence in calibration.quality.warnings if sentence.startswith("view ")]
    named = {int(sentence.split()[1].rstrip(":")) for sentence in aside}
    assert wrong <= named
    assert len(named - wrong) <= 1
    readings = looking.readings(np.random.default_rng(seed), 40)
    moved = inverse(most_likely(seed).world_from_camera(readings)) @ calibration.world_from_camera(readings)
    twists = np.concatenate([rotation_log(moved), moved[:, :3, 3]], axis=1)
    covariance = most_likely(seed).pose_covariance(readings)
    assert covariance is not None
    distances = (twists * np.linalg.solve(covariance, twists[..., None])[..., 0]).sum(axis=1)
    # Fewer measurements are another sample: well within the claimed ellipsoid, whose 6 dimensions are 6 on average.
    assert np.median(distances) < 6


def test_noisy_readings_are_found_out() -> None:
    looking, session = rig_and_session(1)
    rng = np.random.default_rng(9)
    document = session.model_dump(exclude_unset=True)
    for view in document["views"]:
        view["readings"] = [reading + 0.05 * rng.normal() for reading in view["readings"]]
    noisy = Session.model_validate(document)
    plain, aware = errors(most_likely(1), looking, 1)[1], errors(solve(noisy), looking, 1)[1]
    assert np.median(np.trace(aware, axis1=1, axis2=2) / np.trace(plain, axis1=1, axis2=2)) > 1.5
    assert not [
        w for w in solve(noisy).quality.warnings if "set aside" in w and "view" in w and "points" not in w
    ]


def test_the_prints_scale_limits_every_length_and_no_angle() -> None:
    looking, session = rig_and_session(2)
    target = {**session.target.model_dump(exclude_unset=True), "pitch_std": 0.03e-2}
    unsure = solve(Session.model_validate(session.model_dump(exclude_unset=True) | {"target": target}))
    readings = looking.readings(np.random.default_rng(2), 10)
    sure, less = most_likely(2).pose_covariance(readings), unsure.pose_covariance(readings)
    assert sure is not None
    assert less is not None
    distance = np.linalg.norm(unsure.world_from_camera(readings)[:, :3, 3], axis=1)
    grown = np.trace((less - sure)[:, 3:, 3:], axis1=1, axis2=2)
    assert np.allclose(np.sqrt(grown), 0.01 * distance, rtol=1e-6)
    assert np.allclose(less[:, :3, :3], sure[:, :3, :3])


def test_known_intrinsics_stay_as_they_are() -> None:
    _, session = rig_and_session(3)
    lens = most_likely(3).cameras[0].intrinsics
    assert lens is not None
    known = lens.model_copy(update={"fx": lens.fx * 1.001})
    document = session.model_dump(exclude_unset=True)
    document["cameras"][0]["intrinsics"] = known.model_dump()
    kept = solve(Session.model_validate(document)).cameras[0].intrinsics
    assert kept is not None
    assert kept.fx == known.fx
    assert kept.distortion == known.distortion


def test_leaving_a_view_out_by_the_jacobian_is_leaving_it_out() -> None:
    """The held-out error of a view equals that against an actual fit without it."""
    _, session = rig_and_session(5)
    whole = most_likely(5)
    assert whole.quality.held_out_by == "leave_one_view_out"
    for left_out in (0, 9, 17):
        views = [
            view.model_copy(update={"use": "verify"}) if index == left_out else view
            for index, view in enumerate(session.views)
        ]
        without = solve(session.with_views(views)).quality
        assert without.held_out_by == "verify"
        stated = next(view.held_out_px for view in whole.quality.views if view.view == left_out)
        assert stated == pytest.approx(without.held_out_rms_px, rel=0.02)
    assert whole.quality.held_out_rms_px is not None
    assert whole.quality.rms_px is not None
    assert whole.quality.held_out_rms_px > whole.quality.rms_px
