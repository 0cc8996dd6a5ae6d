"""A session that was cut off is solved as far as it goes; a complete one with too little is refused."""

import numpy as np
import pytest

from calib import solve
from calib.errors import UnsolvableError
from calib.session import Session
from calib.sweeps import reading_spans
from calib.unfinished import finished_part
from tests.calib.rigs import pose_session, random_rig

RIG = random_rig(np.random.default_rng(11), ["prismatic", "revolute"], ["skew"])
SLIDE = [("j0", np.array([s, 0.2]) / RIG.scales) for s in np.linspace(0, 1, 6)]
PAN = [("j1", np.array([0.5, 0.2 + s]) / RIG.scales) for s in np.linspace(0, 1, 6)]


def cut_off(count: int) -> Session:
    return pose_session(RIG, (SLIDE + PAN)[:count], complete=False)


@pytest.mark.parametrize("count", [2, 4, 6, 7])
def test_the_finished_joint_is_solved(count: int) -> None:
    calibration = solve(cut_off(count))
    assert [joint.name for joint in calibration.joints] == ["j0"]
    assert "joint 'j1' was not exercised and counts as fixed" in calibration.quality.warnings[0]
    predicted = calibration.world_from_camera([0.7 / RIG.scales[0]])
    assert np.allclose(predicted, RIG.pose(np.array([0.7, 0.2]) / RIG.scales), atol=1e-8)


def test_the_sides_of_the_joints_that_remain_are_kept() -> None:
    session = cut_off(6)
    views = [view.model_copy(update={"approached": [1, -1]}) for view in session.views]
    kept = finished_part(session.with_views(views)).session
    assert [view.approached for view in kept.views] == [[1]] * 6
    assert [view.approached for view in finished_part(session).session.views] == [None] * 6


def test_all_joints_once_they_are_begun() -> None:
    calibration = solve(cut_off(8))
    assert [joint.name for joint in calibration.joints] == ["j0", "j1"]
    assert calibration.quality.warnings[0].startswith("the session was cut off after 8 views")
    assert np.allclose(calibration.world_from_camera(PAN[5][1]), RIG.pose(PAN[5][1]), atol=1e-8)


def test_the_second_joint_first() -> None:
    calibration = solve(pose_session(RIG, PAN, complete=False))
    assert [joint.name for joint in calibration.joints] == ["j1"]
    assert np.allclose(calibration.world_from_camera(PAN[5][1][1:]), RIG.pose(PAN[5][1]), atol=1e-8)


def test_nothing_to_solve_yet() -> None:
    with pytest.raises(UnsolvableError, match="cut off after 1 views"):
        solve(cut_off(1))


@pytest.mark.parametrize(
    ("views", "sentence"),
    [
        (SLIDE, "joint 'j1' was never moved alone"),
        ([*SLIDE, PAN[0]], "joint 'j1' has one view only"),
        ([*SLIDE, PAN[0], PAN[0]], "joint 'j1' has 2 views, but no two from one start"),
    ],
)
def test_a_complete_session_must_have_all_joints(views: list[tuple[str, np.ndarray]], sentence: str) -> None:
    with pytest.raises(UnsolvableError, match=sentence):
        solve(pose_session(RIG, views))


def test_steps_of_half_a_turn_are_refused() -> None:
    rig = random_rig(np.random.default_rng(1), ["revolute"], [])
    wide = [("j0", np.array([angle]) / rig.scales) for angle in (0.0, 0.5, 1.0, 5.5)]
    with pytest.raises(UnsolvableError, match="less than half a turn apart, so take views in between"):
        solve(pose_session(rig, wide))


@pytest.mark.parametrize("count", [5, 7, 9, 12, 14, 16, 19])
def test_readings_of_joints_that_stand_still_jitter(count: int) -> None:
    """Nobody knows how noisy joints are that were not exercised yet: what they differ by is no other start."""
    rig = random_rig(
        np.random.default_rng(2), ["revolute", "prismatic", "revolute", "revolute"], ["skew"] * 3
    )
    starts = np.array([[0.0, 0.1, 0.2, -0.1], [0.3, 0.0, 0.2, -0.1]])
    sweeps = [("j0", 0, starts[0]), ("j1", 1, starts[1]), ("j2", 2, starts[1])]
    noise = np.random.default_rng(5)
    views = []
    for name, joint, start in sweeps:
        for step in np.linspace(-0.3, 0.3, 7):
            at = start + (np.arange(4) == joint) * step
            views.append((name, at, at + 1e-5 * noise.integers(-2, 3, 4)))
    session = pose_session(
        rig, [(name, read / rig.scales) for name, _, read in views[:count]], complete=False
    )
    poses = [rig.pose(at / rig.scales).tolist() for _, at, _ in views]
    placed = [
        view.model_copy(update={"world_from_camera": pose})
        for view, pose in zip(session.views, poses, strict=False)
    ]
    part = finished_part(session.with_views(placed))
    begun = 1 + (count - 2) // 7
    assert [joint.name for joint in part.session.joints] == ["j0", "j1", "j2"][:begun]
    assert part.sentence is not None
    calibration = solve(session.with_views(placed))
    moved = {0: slice(0, 7), 1: slice(7, 14), 2: slice(14, 21)}[begun - 1]
    kept = [at for _, at, _ in views[moved]][: count - 7 * (begun - 1)]
    found = calibration.world_from_camera([(at / rig.scales)[:begun] for at in kept])
    assert np.allclose(found, [rig.pose(at / rig.scales) for at in kept], atol=3e-4)


def test_two_values_are_two_starts_unless_they_alternate() -> None:
    exercised = np.zeros(6, dtype=int)
    moved = np.arange(6.0)
    for idle, span in (([0, 0, 0, 5, 5, 5], 5.0), ([0, 5, 0, 0, 5, 0], np.inf), ([5] * 6, 0.0)):
        assert reading_spans(np.column_stack([moved, idle]), exercised).tolist() == [5.0, span]


def test_a_joint_that_did_not_turn_is_refused() -> None:
    rig = random_rig(np.random.default_rng(1), ["revolute"], [])
    views = [("j0", np.array([0.0])), ("j0", np.array([1.0]))]
    session = pose_session(rig, views)
    still = session.views[1].model_copy(update={"world_from_camera": session.views[0].world_from_camera})
    with pytest.raises(UnsolvableError, match="did not turn"):
        solve(session.with_views([session.views[0], still]))


def test_what_is_held_of_a_joint_that_was_not_begun_does_not_matter() -> None:
    held = {"j0.scale": float(RIG.scales[0]), "j1.scale": 1.0}
    calibration = solve(cut_off(4), hold=held)
    assert calibration.held == {"j0.scale": RIG.scales[0]}
