"""What a calibration is called, and why: never good by its residual alone."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.random_rigs import LookingRig, looking_rig, noisy_session, session_header, session_of_views
from calib import Calibration, solve
from calib.session import Session
from calib.stated_quality import MeanAndMax, Quality, ViewQuality
from calib.verdict import judgement_and_verdict
from tests.calib.likelihood.weak_rigs import pan_and_tilt, seen, slide_along_the_line_of_sight
from tests.calib.rigs import pose_session


def quality(count: int = 20, **keys: Any) -> Quality:
    """Return the quality of a calibration that is good, but for `keys`."""
    known = {
        "rms_px": 0.1,
        "held_out_rms_px": 0.11,
        "held_out_by": "leave_one_view_out",
        "predicted_px": 0.1,
        "position_std_m": MeanAndMax(mean=1e-4, max=2e-4),
        "rotation_std_rad": MeanAndMax(mean=1e-4, max=2e-4),
        "views": [ViewQuality(view=i, joint="pan", use="fit", held_out_px=0.11) for i in range(count)],
    }
    return Quality(**(known | keys))


def aside(count: int) -> list[ViewQuality]:
    """Return 20 views, of which so many were set aside."""
    left = {"joint": "pan", "use": "fit"}
    return [
        ViewQuality(view=i, set_aside=i < count, held_out_px=None if i < count else 0.11, **left)
        for i in range(20)
    ]


@pytest.mark.parametrize(
    ("keys", "judgement", "because"),
    [
        ({}, "good", "predicted by all others to 0.11 px"),
        ({"held_out_by": None, "held_out_rms_px": None}, "unknown", "no view was held out"),
        ({"rms_px": 0.02}, "poor", "5.5 times as much as those of the fit"),
        ({"rms_px": 0.05}, "usable", "2.2 times as much as those of the fit"),
        ({"rms_px": 0.08}, "good", "those of the fit to 0.08 px"),
        ({"rms_px": 0.05, "count": 2}, "usable", "only 2 views were held out"),
        ({"rms_px": 0.6, "held_out_rms_px": 0.7}, "usable", "7 times what noise explains"),
        ({"rms_px": 1.9, "held_out_rms_px": 2.0}, "poor", "20 times what noise explains"),
        (
            {"rms_px": 5.0, "predicted_px": 5.0, "held_out_rms_px": 5.1},
            "poor",
            "look for a joint that slips",
        ),
        ({"predicted_px": 0.005, "held_out_rms_px": 0.1}, "usable", "20 times what noise explains"),
        ({"views": aside(1)}, "good", "predicted"),
        ({"views": aside(2)}, "usable", "2 of 20 views were set aside"),
        ({"views": aside(5)}, "poor", "5 of 20 views were set aside"),
        ({"position_std_m": None, "rotation_std_rad": None}, "usable", "how sure its poses are is not known"),
    ],
)
def test_each_rule_makes_the_judgement_that_it_should(
    keys: dict[str, Any], judgement: str, because: str
) -> None:
    found, sentence = judgement_and_verdict(quality(**keys), True, [])
    assert found == judgement
    assert sentence.lower().startswith(judgement)
    assert because in sentence


@pytest.mark.parametrize("said", [True, False])
def test_what_noisy_readings_explain_is_not_held_against_a_rig(said: bool) -> None:
    """Encoders of 0.05 deg and 0.05 mm: predictions miss by many times what points scatter by, as they should."""
    rng = np.random.default_rng(4)
    looking = looking_rig(rng, 3)
    plan = [*looking.plan(), *((None, at) for at in looking.readings(rng, 12))]
    true = np.array([at for _, at in plan])
    pixels = looking.pixels(true) + 0.1 * rng.normal(size=(len(plan), 42, 2))
    read = [(joint, at + 0.05 * rng.normal(size=3)) for joint, at in plan]
    session = session_of_views(looking, read, pixels)
    joints = [joint.model_copy(update={"reading_std": 0.05 if said else None}) for joint in session.joints]
    views = [view if view.joint else view.model_copy(update={"use": "verify"}) for view in session.views]
    found = solve(session.model_copy(update={"joints": joints}).with_views(views)).quality
    assert found.held_out_rms_px is not None
    assert found.noise_px is not None
    assert found.held_out_rms_px > 5 * found.noise_px
    assert found.predicted_px is not None
    assert found.rms_px is not None
    # What is not told has to be found in the sweeps, one joint at a time.
    assert (0.7 if said else 0.4) < found.predicted_px / found.rms_px < 1.3
    assert found.judgement == "good", found.verdict


def test_without_noisy_readings_predictions_should_miss_by_little_more_than_points_scatter() -> None:
    found = solved().quality
    assert found.noise_px is not None
    assert found.predicted_px == pytest.approx(found.held_out_rms_px, rel=0.05)
    assert found.noise_px < found.predicted_px < 1.2 * found.noise_px


def test_what_no_noise_explains_is_held_against_a_rig() -> None:
    """An arm that bends: its views scatter every way, and no reading is to blame."""
    rng = np.random.default_rng(5)
    looking = looking_rig(rng, 3)
    plan = [*looking.plan(), *((None, at) for at in looking.readings(rng, 12))]
    poses = looking.rig.poses(np.array([at for _, at in plan]))
    poses[:, :3, 3] += 1e-3 * rng.normal(size=(len(plan), 3))
    turns = Rotation.from_rotvec(1e-3 * rng.normal(size=(len(plan), 3))).as_matrix()
    poses[:, :3, :3] = poses[:, :3, :3] @ turns
    pixels = looking.seen_from(poses) + 0.1 * rng.normal(size=(len(plan), 42, 2))
    joints = [{**joint, "reading_std": 0.001} for joint in session_header(looking)["joints"]]
    session = session_of_views(looking, plan, pixels).model_dump(exclude_unset=True)
    found = solve(Session.model_validate({**session, "joints": joints})).quality
    assert found.judgement in {"usable", "poor"}
    assert found.verdict is not None
    assert "times what noise explains" in found.verdict


def test_a_session_that_was_cut_off_is_not_good() -> None:
    judgement, sentence = judgement_and_verdict(quality(), False, [])
    assert judgement == "usable"
    assert "cut off" in sentence


@cache
def rig_and_session() -> tuple[LookingRig, Session]:
    rng = np.random.default_rng(1)
    looking = looking_rig(rng, 3)
    return looking, noisy_session(looking, rng)


@cache
def solved() -> Calibration:
    return solve(rig_and_session()[1])


def test_a_good_rig_is_good_and_its_figures_are_the_tables() -> None:
    found = solved().quality
    assert found.judgement == "good"
    assert found.noise_px == pytest.approx(0.1 * np.sqrt(2), rel=0.05)
    assert [row.joint for row in found.joints] == ["j0", "j1", "j2"]
    assert sum(row.views for row in found.joints) == len(found.views)
    squares = [row.held_out_px**2 for row in found.joints if row.held_out_px is not None]
    assert np.sqrt(np.mean(squares)) == pytest.approx(found.held_out_rms_px)


def test_the_claimed_pose_is_that_of_the_covariance() -> None:
    covariance = solved().pose_covariance(rig_and_session()[1].readings())
    assert covariance is not None
    spread = solved().quality.position_std_m
    assert spread is not None
    each = np.sqrt(np.trace(covariance[:, 3:, 3:], axis1=1, axis2=2))
    assert spread.mean == pytest.approx(each.mean())
    assert spread.max == pytest.approx(each.max())


def test_the_closed_form_without_views_to_verify_with_is_never_called_good() -> None:
    found = solve(rig_and_session()[1], "closed_form").quality
    assert found.rms_px is not None
    assert found.rms_px < 0.5
    assert found.judgement == "unknown"


def test_a_rig_that_slipped_before_its_verification_is_poor() -> None:
    """The residual of the fit knows nothing of it."""
    looking, _ = rig_and_session()
    rng = np.random.default_rng(3)
    plan = [*looking.plan(), *((None, at) for at in looking.readings(rng, 8))]
    true = np.array([at for _, at in plan])
    true[len(looking.plan()) :, 0] += 1.0
    pixels = looking.pixels(true) + 0.1 * rng.normal(size=(len(plan), 42, 2))
    session = session_of_views(looking, plan, pixels)
    views = [view if view.joint else view.model_copy(update={"use": "verify"}) for view in session.views]
    found = solve(session.with_views(views)).quality
    assert found.rms_px == pytest.approx(0.14, abs=0.02)
    assert found.judgement == "poor"
    assert found.held_out_by == "verify"
    assert found.verdict is not None
    assert "times as much as those of the fit" in found.verdict
    assert next(row for row in found.joints if row.joint is None).held_out_px == found.held_out_rms_px


def test_what_cannot_be_told_apart_is_in_the_verdict() -> None:
    looking = pan_and_tilt(0, 5, 5)
    found = solve(seen(looking, looking.plan(), seed=0)).quality
    assert found.judgement == "usable"
    assert found.verdict is not None
    assert "can't be told apart" in found.verdict
    slide = slide_along_the_line_of_sight()
    assert solve(seen(slide, slide.plan(), seed=0)).quality.judgement == "poor"


def test_views_that_were_set_aside_count_nowhere_but_in_their_own_row() -> None:
    document = rig_and_session()[1].model_dump(exclude_unset=True)
    document["views"][4]["readings"][0] += 5.0
    found = solve(Session.model_validate(document)).quality
    assert [view.view for view in found.views if view.set_aside] == [4]
    assert found.views[4].rms_px is not None
    assert found.views[4].rms_px > 10
    assert found.rms_px == pytest.approx(0.14, abs=0.02)
    assert found.joints[0].views == 8


def test_given_poses_are_held_out_view_by_view() -> None:
    looking, session = rig_and_session()
    rng = np.random.default_rng(0)
    exact = pose_session(looking.rig, [(view.joint, np.array(view.readings)) for view in session.views])
    views = []
    for view in exact.views:
        pose = np.array(view.world_from_camera)
        pose[:3, 3] += 1e-3 * rng.normal(size=3)
        views.append(view.model_copy(update={"world_from_camera": pose.tolist()}))
    found = solve(exact.with_views(views)).quality
    assert found.judgement in {"good", "usable"}
    each = [view.held_out_position_m for view in found.views]
    assert all(position is not None and position > 0 for position in each)
    assert np.mean(each) == pytest.approx(found.held_out_position_m)
    assert found.noise_px is None
    assert found.verdict is not None
    assert " mm and " in found.verdict
