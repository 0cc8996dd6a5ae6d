"""A symmetric target must not turn the world round, between views or from one solution to the next."""

from typing import Any

import numpy as np
import pytest

from calib import solve
from calib.session import Session
from calib.transforms import pose_error
from tests.calib.rigs import Rig, sweep_session
from tests.calib.scenes import DISK_CENTRES, DISKS, plan, points_session, two_axis_rig


def upside_down(session: Session, views: list[int]) -> Session:
    """Return the session with the points of some views labelled from the opposite corner."""
    last = len(DISK_CENTRES) - 1
    document = session.model_dump(exclude_unset=True)
    for index in views:
        points = document["views"][index]["points"]
        points["ids"] = [last - label for label in points["ids"]]
    return Session.model_validate(document)


def assert_true(session: Session, rig: Rig) -> None:
    calibration = solve(session)
    readings = np.array([[0.0, 0.0], [50.0, -5.0], [-80.0, 7.0]])
    distance, angle = pose_error(
        calibration.world_from_camera(readings), np.array([rig.pose(at) for at in readings])
    )
    assert distance.max() < 2e-4
    assert angle.max() < 2e-4


@pytest.mark.parametrize("flipped", [[3], [1, 2, 5], list(range(1, 18, 2)), list(range(1, 18))])
def test_the_readings_decide(flipped: list[int]) -> None:
    rig = two_axis_rig()
    assert_true(upside_down(points_session(rig, plan(), DISKS, DISK_CENTRES), flipped), rig)


def test_the_stored_choice_outlives_the_first_view() -> None:
    """Dropping views, or reading the new first one the other way round, leaves the world as it was."""
    rig = two_axis_rig()
    session = points_session(rig, plan(), DISKS, DISK_CENTRES)
    origin = solve(session).origin
    assert origin is not None
    later = upside_down(session.with_views(session.views[2:]), list(range(len(session.views) - 2)))
    assert_true(later.model_copy(update={"origin": origin}), rig)


def test_without_a_stored_choice_the_first_view_makes_it() -> None:
    rig = two_axis_rig()
    session = points_session(rig, plan(), DISKS, DISK_CENTRES)
    turned = solve(upside_down(session, list(range(len(session.views))))).world_from_camera([0.0, 0.0])
    half_turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    half_turn[:3, 3] = DISK_CENTRES[-1]
    assert np.allclose(half_turn @ turned, rig.pose(np.zeros(2)), atol=2e-4)


def test_given_poses_are_never_turned() -> None:
    rig = two_axis_rig()
    session = sweep_session(rig, np.random.default_rng(0), [0, 1])
    document: dict[str, Any] = session.model_dump(exclude_unset=True) | {"target": DISKS}
    calibration = solve(Session.model_validate(document))
    assert np.allclose(calibration.world_from_camera([5.0, 5.0]), rig.pose(np.array([5.0, 5.0])), atol=1e-8)
