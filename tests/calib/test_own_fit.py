"""What a view's own fit tells: the noise of its points, and which view is worse than the others."""

import numpy as np

from calib.observations import observe
from calib.own_fit import own_fits
from calib.session import Points, Session
from tests.calib.rigs import pose_session, random_rig
from tests.calib.scenes import DISK_CENTRES, plan, points_session, two_axis_rig

GRID = {"kind": "chessboard", "rows": 6, "columns": 7, "pitch": 0.03}


def noisy(session: Session, std: dict[int, float]) -> Session:
    """The same views, their points off by 0.1 px (rms a coordinate) or by `std` of their number."""
    rng, views = np.random.default_rng(7), []
    for number, view in enumerate(session.views):
        assert view.points is not None
        pixels = np.array(view.points.pixels)
        pixels += rng.normal(0, std.get(number, 0.1), pixels.shape)
        points = Points(ids=view.points.ids, pixels=pixels.tolist())
        views.append(view.model_copy(update={"points": points}))
    return session.with_views(views)


def test_a_view_that_is_blurred_stands_out() -> None:
    session = noisy(points_session(two_axis_rig(), plan(), GRID, DISK_CENTRES), {4: 1.5})
    fits = own_fits(session, observe(session).observations)
    assert sorted(fits) == list(range(18))
    # Of 84 numbers of each view six go into its pose.
    expected = np.sqrt(2) * np.sqrt(1 - 6 / 84)
    assert abs(fits[4] - 1.5 * expected) < 0.3
    assert all(abs(fits[view] - 0.1 * expected) < 0.05 for view in fits if view != 4)


def test_too_few_views_to_tell_a_lens_tell_nothing() -> None:
    session = points_session(two_axis_rig(), plan()[:1], GRID, DISK_CENTRES)
    flat = session.with_views(
        [
            view.model_copy(update={"points": Points(ids=[0, 1], pixels=[[1, 1], [2, 2]])})
            for view in session.views
        ]
    )
    assert own_fits(flat, observe(flat).observations) == {}


def test_given_poses_have_no_points_to_miss() -> None:
    session = pose_session(random_rig(np.random.default_rng(1), ["revolute"], []), [("j0", np.array([0.1]))])
    assert own_fits(session, observe(session).observations) == {}
