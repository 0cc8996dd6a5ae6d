"""On exact poses both methods are exact: against a forward model of matrix exponentials, for any chain."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from calib import Calibration, solve
from calib.dh import link_transform
from calib.document import Method
from calib.transforms import pose_error
from tests.calib.rigs import Rig, pose_session, random_rig, rigs, sweep_session

TOLERANCE = 1e-8


def assert_predicts(calibration: Calibration, rig: Rig, rng: np.random.Generator, reach: float = 1.5) -> None:
    readings = rng.uniform(-reach, reach, (20, len(rig.kinds))) / rig.scales
    true = np.array([rig.pose(at) for at in readings])
    distance, angle = pose_error(calibration.world_from_camera(readings), true)
    assert max(distance.max(), angle.max()) < TOLERANCE


@settings(max_examples=100, deadline=None)
@given(rigs(), st.data())
def test_any_chain_in_any_order_from_any_start(
    drawn: tuple[Rig, np.random.Generator], data: st.DataObject
) -> None:
    rig, rng = drawn
    order = data.draw(st.permutations(range(len(rig.kinds))))
    method: Method = data.draw(st.sampled_from(["closed_form", "closed_form", "closed_form", "ml"]))
    calibration = solve(sweep_session(rig, rng, order), method)
    assert_predicts(calibration, rig, rng)
    assert all(joint.scale > 0 for joint in calibration.joints)


@settings(max_examples=25, deadline=None)
@given(rigs(joints=(1, 3)), st.floats(1.0, 6.0))
def test_many_turns(drawn: tuple[Rig, np.random.Generator], turns: float) -> None:
    rig, rng = drawn
    calibration = solve(sweep_session(rig, rng, list(range(len(rig.kinds))), turns), "closed_form")
    assert_predicts(calibration, rig, rng)


@settings(max_examples=25, deadline=None)
@given(rigs(joints=(2, 4)))
def test_one_joint_swept_from_several_starts(drawn: tuple[Rig, np.random.Generator]) -> None:
    rig, rng = drawn
    order = list(range(len(rig.kinds)))
    calibration = solve(sweep_session(rig, rng, order + order), "closed_form")
    assert_predicts(calibration, rig, rng)


@settings(max_examples=40, deadline=None)
@given(rigs())
def test_dh_is_the_same_chain(drawn: tuple[Rig, np.random.Generator]) -> None:
    rig, rng = drawn
    calibration = solve(sweep_session(rig, rng, list(range(len(rig.kinds)))), "closed_form")
    nearly_parallel = max((abs(row.d_offset) for row in calibration.dh), default=0) > 1e3
    if nearly_parallel:
        return
    for at in rng.uniform(-1, 1, (5, len(rig.kinds))) / rig.scales:
        pose = np.array(calibration.world_from_base)
        for joint, row, reading in zip(calibration.joints, calibration.dh, at, strict=True):
            pose = pose @ link_transform(joint.kind, *row_values(row), reading)
        pose = pose @ np.array(calibration.cameras[0].link_from_camera)
        assert np.abs(pose - rig.pose(at)).max() < 1e-7


def row_values(row: object) -> list[float]:
    return [getattr(row, key) for key in ("a_prev", "alpha_prev", "d_offset", "theta_offset", "scale")]


@settings(max_examples=25, deadline=None)
@given(rigs())
def test_dh_conventions(drawn: tuple[Rig, np.random.Generator]) -> None:
    """Eq 12 and 13: the base is frame 1 at reading 0, and the last link has no offsets."""
    rig, rng = drawn
    calibration = solve(sweep_session(rig, rng, list(range(len(rig.kinds)))), "closed_form")
    first, last = calibration.dh[0], calibration.dh[-1]
    assert row_values(first)[:4] == [0, 0, 0, 0]
    assert abs(last.d_offset) < TOLERANCE
    assert abs(last.theta_offset) < 1e-6
    assert np.allclose(np.array(calibration.world_from_base)[:3, 2], calibration.joints[0].axis, atol=1e-9)


def test_starts_close_to_each_other_are_told_apart() -> None:
    rng = np.random.default_rng(8)
    rig = random_rig(rng, ["revolute", "revolute"], ["skew"])
    steps = np.linspace(-0.6, 0.6, 7)
    views = [("j0", np.array([step, 0.3]) / rig.scales) for step in steps]
    views += [("j1", np.array([start, step]) / rig.scales) for start in (0.2, 0.203) for step in steps]
    assert_predicts(solve(pose_session(rig, views), "closed_form"), rig, rng)


def test_screws_of_a_known_rig() -> None:
    """The primary result: axis along growing readings, the point nearest the world's origin, the scale."""
    rng = np.random.default_rng(3)
    rig = random_rig(rng, ["revolute", "prismatic"], ["skew"])
    calibration = solve(sweep_session(rig, rng, [1, 0]))
    pan, slide = calibration.joints
    assert np.allclose(pan.axis, rig.axes[0], atol=TOLERANCE)
    assert np.allclose(pan.point, rig.points[0] - rig.points[0] @ rig.axes[0] * rig.axes[0], atol=TOLERANCE)
    assert np.allclose(slide.axis, rig.axes[1], atol=TOLERANCE)
    assert np.allclose(slide.point, rig.mount[:3, 3], atol=TOLERANCE)
    assert np.allclose([pan.scale, slide.scale], rig.scales, rtol=1e-9)


def test_camera_on_an_earlier_link() -> None:
    rng = np.random.default_rng(4)
    rig = random_rig(rng, ["revolute", "revolute"], ["square"])
    session = sweep_session(rig, rng, [0, 1])
    lower = Rig(rig.kinds[:1], rig.axes[:1], rig.points[:1], rig.scales[:1], np.linalg.inv(rig.mount))
    extra = [
        {
            **view.model_dump(exclude_unset=True),
            "camera": "low",
            "world_from_camera": lower.pose(view.readings[:1]),
        }
        for view in session.views
        if view.joint == "j0"
    ]
    both = session.model_dump(exclude_unset=True)
    both["cameras"] = [{"name": "main"}, {"name": "low", "link": "j0"}]
    both["views"] += [{**view, "world_from_camera": view["world_from_camera"].tolist()} for view in extra]
    calibration = solve(type(session).model_validate(both))
    at = np.array([0.3, -0.8]) / rig.scales
    assert np.allclose(calibration.world_from_camera(at), rig.pose(at), atol=TOLERANCE)
    assert np.allclose(calibration.world_from_camera(at, "low"), lower.pose(at[:1]), atol=TOLERANCE)


def test_idle_readings_may_jitter() -> None:
    """An idle joint stands still: its readings' jitter is noise, and no motion is made of it."""
    rng = np.random.default_rng(5)
    rig = random_rig(rng, ["revolute", "prismatic"], ["skew"])
    steps = np.linspace(0, 1, 9)
    true = [("j0", np.array([s, 0.2]) / rig.scales) for s in steps]
    true += [("j1", np.array([0.4, 0.5 * s]) / rig.scales) for s in steps]
    session = pose_session(rig, true)
    for view, idle in zip(session.views, [1] * 9 + [0] * 9, strict=True):
        view.readings[idle] += rng.normal() * 1e-4 / rig.scales[idle]
    calibration = solve(session)
    predicted = calibration.world_from_camera([at for _, at in true])
    distance, angle = pose_error(predicted, np.array([rig.pose(at) for _, at in true]))
    assert max(distance.max(), angle.max()) < 2e-4
    assert np.allclose(calibration.joints[0].axis, rig.axes[0], atol=TOLERANCE)
