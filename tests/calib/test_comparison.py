"""Two calibrations of one rig, of which it is known whether it has changed."""

import numpy as np
import pytest
from scipy.linalg import expm

from benchmarks.true_rig import Rig
from calib import Calibration, solve
from calib.comparison import compare
from calib.errors import CalibError
from calib.session import Points, Session
from tests.calib.scenes import DISK_CENTRES, FOCAL, HEIGHT, WIDTH, plan, points_session, two_axis_rig

GRID = {"kind": "chessboard", "rows": 6, "columns": 7, "pitch": 0.03}

LENS = {
    "model": "opencv", "width": WIDTH, "height": HEIGHT, "fx": FOCAL, "fy": FOCAL, "cx": WIDTH / 2,
    "cy": HEIGHT / 2, "distortion": [0.0, 0.0, 0.0, 0.0, 0.0],
}  # fmt: skip
CAMERA = {"name": "main", "width": WIDTH, "height": HEIGHT, "intrinsics": LENS}


def noisy(session: Session, seed: int) -> Session:
    rng, views = np.random.default_rng(seed), []
    for view in session.views:
        assert view.points is not None
        pixels = np.array(view.points.pixels)
        pixels += rng.normal(0, 0.1, pixels.shape)
        views.append(view.model_copy(update={"points": Points(ids=view.points.ids, pixels=pixels.tolist())}))
    return session.with_views(views)


def calibrated(seed: int, rig: Rig | None = None, points: np.ndarray = DISK_CENTRES) -> Calibration:
    session = points_session(rig or two_axis_rig(), plan(), GRID, points, cameras=[CAMERA])
    return solve(noisy(session, seed))


def moved_rig(motion: np.ndarray) -> Rig:
    """The rig as it is seen from a target that was moved by `motion`: the world goes with the target."""
    rig, back = two_axis_rig(), np.linalg.inv(motion)
    return Rig(
        rig.kinds,
        rig.axes @ back[:3, :3].T,
        rig.points @ back[:3, :3].T + back[:3, 3],
        rig.scales,
        back @ rig.mount,
    )


@pytest.fixture(scope="module")
def first() -> Calibration:
    return calibrated(1)


def test_a_calibration_agrees_with_itself(first: Calibration) -> None:
    found = compare(first, first)
    assert (found.agree, found.agree_apart_from_world) == (True, True)
    assert found.sentence.startswith("They say the same: ")
    assert found.poses.position_max_m == 0.0
    assert all(one.difference == 0.0 for one in found.parameters)


def test_two_runs_of_the_same_rig_agree(first: Calibration) -> None:
    found = compare(first, calibrated(2))
    assert found.agree
    assert found.sentence.startswith(
        "They agree: over the range that both have, the camera's position differs by "
    )
    assert found.poses.stds is not None
    assert 0.1 < found.poses.stds < 3
    assert 0 < found.poses.position_mean_m <= found.poses.position_max_m
    assert found.range == [pytest.approx([-100, 100]), pytest.approx([-8, 8])]
    scale = next(one for one in found.parameters if one.name == "slide.scale")
    assert scale.difference == scale.second - scale.first
    assert scale.std == pytest.approx(np.hypot(first.joints[0].scale_std or 0, scale.std), rel=0.5)
    stds = [one.stds for one in found.parameters if one.stds is not None]
    assert 0.2 < np.sqrt(np.mean(np.square(stds))) < 2


def test_a_target_that_was_moved_is_told_from_a_rig_that_has_changed(first: Calibration) -> None:
    motion = np.eye(4)
    motion[:3, :3] = expm(np.cross(np.eye(3), [0.0, 0.02, 0.03]))
    motion[:3, 3] = [0.01, -0.02, 0.005]
    found = compare(first, calibrated(3, moved_rig(motion)))
    assert (found.agree, found.agree_apart_from_world) == (False, True)
    assert found.sentence.startswith("The target stood elsewhere, by ")
    assert found.moved_m == pytest.approx(np.linalg.norm(np.linalg.inv(motion)[:3, 3]), abs=2e-3)
    assert found.moved_rad == pytest.approx(np.hypot(0.02, 0.03), abs=1e-3)
    assert found.poses.position_max_m > 10 * found.poses_apart_from_world.position_max_m


def test_a_rig_that_has_changed_is_said_to(first: Calibration) -> None:
    rig = two_axis_rig()
    stretched = Rig(rig.kinds, rig.axes, rig.points, rig.scales * [1.02, 1.0], rig.mount)
    found = compare(first, calibrated(4, stretched))
    assert (found.agree, found.agree_apart_from_world) == (False, False)
    assert found.sentence.startswith("They differ: ")
    worst = max((one for one in found.parameters if one.frame == "none"), key=lambda one: one.stds or 0)
    assert f"most of all {worst.name}, by " in found.sentence
    scale = next(one for one in found.parameters if one.name == "slide.scale")
    assert scale.difference / scale.first == pytest.approx(0.02, abs=2e-3)
    assert scale.stds is not None
    assert scale.stds > 3


def test_without_deviations_nothing_is_promised(first: Calibration) -> None:
    unsure = Calibration.model_validate(calibrated(2).model_dump() | {"covariance": None})
    found = compare(unsure, first)
    assert (found.agree, found.poses.stds) == (None, None)
    assert found.sentence.endswith("how much is to be expected is not known")


def test_what_cannot_be_compared_is_refused(first: Calibration) -> None:
    other = first.model_copy(update={"range": [[200.0, 300.0], first.range[1]]})
    with pytest.raises(CalibError, match="no range of 'slide' in common"):
        compare(first, other)
    renamed = first.model_copy(
        update={"joints": [first.joints[0].model_copy(update={"name": "rail"}), first.joints[1]]}
    )
    with pytest.raises(CalibError, match="slide, pan, and rail, pan"):
        compare(first, renamed)
