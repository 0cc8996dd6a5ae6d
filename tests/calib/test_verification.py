"""The two verifications, on rigs whose errors are known beforehand."""

import numpy as np
import pytest

from calib import Calibration, solve, verify
from calib.errors import FormatError
from calib.session import Session
from calib.targets import target_points, target_symmetries
from calib.verification import compare
from tests.calib.scenes import DISK_CENTRES, DISKS, FOCAL, plan, points_session, two_axis_rig

SESSION = points_session(two_axis_rig(), plan() + plan(verify=True), DISKS, DISK_CENTRES)


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    return solve(SESSION)


def test_only_held_out_views_are_judged(calibration: Calibration) -> None:
    verdict = verify(calibration, SESSION)
    assert verdict.views == len(plan(verify=True))
    assert {view.joint for view in verdict.per_view} == {"slide", "pan"}


def test_a_right_calibration_predicts_everything(calibration: Calibration) -> None:
    verdict = verify(calibration, SESSION)
    assert verdict.rms_px is not None
    assert verdict.rms_px < 0.01
    slide, pan = verdict.travel
    assert [slide.joint, pan.joint] == ["slide", "pan"]
    for row in slide.rows:
        step = (row.reading - slide.start[0]) * 1e-3
        assert row.predicted == pytest.approx(step, abs=1e-5)
        assert row.measured == pytest.approx(step, abs=1e-4)
        assert row.encoder == pytest.approx(step, abs=1e-12)
    for row in pan.rows:
        step = np.radians(row.reading - pan.start[1])
        assert row.predicted == pytest.approx(step, abs=1e-5)
        assert row.measured == pytest.approx(step, abs=1e-4)
        assert row.encoder is None


def test_a_wrong_scale_shows_in_its_joint_by_its_size(calibration: Calibration) -> None:
    wrong = calibration.model_dump()
    wrong["joints"][0]["scale"] *= 1.01
    verdict = verify(Calibration.model_validate(wrong), SESSION)
    slide, pan = verdict.travel
    longest = slide.rows[-1]
    assert longest.predicted / longest.measured == pytest.approx(1.01, abs=1e-3)
    assert pan.rows[-1].predicted == pytest.approx(pan.rows[-1].measured, abs=1e-4)
    assert verdict.position_m is not None
    assert verdict.position_m.max == pytest.approx(0.01 * 0.063, rel=0.05)


def test_points_are_compared_where_they_were_measured(calibration: Calibration) -> None:
    """Whichever way round a view of a symmetric target was read."""
    target = SESSION.target
    turn = target_symmetries(target)[0].permutation
    view = SESSION.views[3]
    assert view.points is not None
    turned = view.points.model_copy(update={"ids": turn[view.points.ids].tolist()})
    session = SESSION.with_views([view, view.model_copy(update={"points": turned})])
    wrong = calibration.model_dump()
    wrong["cameras"][0]["intrinsics"]["cx"] += 3
    wrongly = Calibration.model_validate(wrong)
    _, residuals = compare(wrongly, session, [0, 1])
    for residual in residuals:
        assert residual.pixels is not None
        predicted = wrongly.project(target_points(target)[residual.ids], view.readings)
        np.testing.assert_allclose(
            residual.places + residual.pixels, predicted, atol=0.1
        )  # but for disks' offsets
        np.testing.assert_allclose(residual.pixels.mean(axis=0), [3, 0], atol=0.02)
    np.testing.assert_array_equal(residuals[0].places, view.points.pixels)


def test_pixel_errors_are_distances_of_points(calibration: Calibration) -> None:
    """A principal point shifted by (3, 4) px puts every point off by 5 px."""
    wrong = calibration.model_dump()
    wrong["cameras"][0]["intrinsics"]["cx"] += 3
    wrong["cameras"][0]["intrinsics"]["cy"] += 4
    verdict = verify(Calibration.model_validate(wrong), SESSION)
    assert verdict.mean_px == pytest.approx(5, abs=0.02)
    assert verdict.rms_px == pytest.approx(5, abs=0.02)
    assert calibration.cameras[0].intrinsics is not None
    assert calibration.cameras[0].intrinsics.fx == pytest.approx(FOCAL, rel=1e-3)


def test_another_rig_is_refused(calibration: Calibration) -> None:
    document = SESSION.model_dump(exclude_unset=True)
    document["joints"][1]["name"] = "tilt"
    for view in document["views"]:
        view["joint"] = {"pan": "tilt"}.get(view["joint"], view["joint"])
    with pytest.raises(FormatError, match="are not the calibration's"):
        verify(calibration, Session.model_validate(document))


def test_an_idle_joint_that_jitters_between_two_counts_leaves_a_sweep_whole(calibration: Calibration) -> None:
    document = SESSION.model_dump(exclude_unset=True)
    for index, view in enumerate(document["views"]):
        if view["joint"] == "pan":
            view["readings"][0] += 0.005 * (index % 2)
    _, pan = verify(calibration, Session.model_validate(document)).travel
    assert len(pan.rows) == len([view for view in plan(verify=True) if view["joint"] == "pan"]) - 1
