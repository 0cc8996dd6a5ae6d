"""The paper's tables for a rig whose truth is known: what they compare, and that their deviations are believable."""

import numpy as np

from calib import Calibration, Verification, solve, verify
from calib.paper_tables import prediction_tables, travel_tables
from calib.session import Points, Session
from tests.calib.scenes import DISK_CENTRES, plan, points_session, project, two_axis_rig

GRID = {"kind": "chessboard", "rows": 6, "columns": 7, "pitch": 0.03}
NOISE = 0.1


def noisy_session(seed: int) -> Session:
    session = points_session(two_axis_rig(), plan() + plan(verify=True), GRID, DISK_CENTRES)
    rng, views = np.random.default_rng(seed), []
    for view in session.views:
        assert view.points is not None
        pixels = np.array(view.points.pixels)
        pixels += rng.normal(0, NOISE, pixels.shape)
        views.append(view.model_copy(update={"points": Points(ids=view.points.ids, pixels=pixels.tolist())}))
    return session.with_views(views)


def judged(seed: int) -> tuple[Calibration, Verification]:
    session = noisy_session(seed)
    calibration = solve(session)
    return calibration, verify(calibration, session)


def test_each_joint_has_its_tables() -> None:
    calibration, verification = judged(1)
    slide, pan = travel_tables(verification, calibration)
    assert [(slide.number, slide.joint), (pan.number, pan.joint)] == [(1, "slide"), (2, "pan")]
    first, *_, last = slide.rows
    # Nine positions over 126 mm, of which the first is what the travel is counted from.
    assert len(slide.rows) == 8
    np.testing.assert_allclose([first.predicted, last.predicted], [0.01575, 0.126], rtol=1e-3)
    assert last.encoder is not None
    assert last.encoder_error == abs(last.predicted - last.encoder)
    np.testing.assert_allclose(last.error, abs(last.predicted - last.measured))
    np.testing.assert_allclose(last.percent, 100 * last.error / last.measured)
    assert all(row.encoder is None and row.encoder_percent is None for row in pan.rows)
    np.testing.assert_allclose(pan.rows[-1].predicted, np.radians(16 * 0.63), rtol=1e-2)

    straight, turning = prediction_tables(verification, calibration)
    assert [(straight.number, straight.joint), (turning.number, turning.joint)] == [(3, "slide"), (4, "pan")]
    views = [row.view for row in straight.rows]
    assert views == [18, 20, 22, 24, 26]  # five of the nine, the ends among them
    assert all(0 < row.mean_px < 5 * NOISE for row in [*straight.rows, *turning.rows])


def test_without_a_calibration_nothing_is_said_of_deviations() -> None:
    _, verification = judged(1)
    assert all(row.std is None for table in travel_tables(verification) for row in table.rows)
    assert all(row.std_px is None for table in prediction_tables(verification) for row in table.rows)


def test_deviations_are_as_large_as_the_errors_that_calibrations_make() -> None:
    rig = two_axis_rig()
    travels: list[float] = []
    pixels: list[float] = []
    for seed in range(8):
        calibration, verification = judged(seed)
        slide, pan = travel_tables(verification, calibration)
        for table, step in ((slide, rig.scales[0] * 126.0), (pan, rig.scales[1] * 16 * 0.63)):
            std = table.rows[-1].std
            assert std is not None
            travels.append((table.rows[-1].predicted - step) / std)
        for table in prediction_tables(verification, calibration):
            for row in table.rows:
                assert row.std_px is not None
                missed = calibration.project(DISK_CENTRES, row.readings) - truth(row.readings)
                pixels.append(float(np.sqrt((missed**2).sum(axis=1).mean())) / row.std_px)
    assert 0.4 < np.sqrt(np.mean(np.square(travels))) < 1.7  # 16 standardised errors
    assert 0.5 < np.sqrt(np.mean(np.square(pixels))) < 1.6


def truth(readings: list[float]) -> np.ndarray:
    return project(DISK_CENTRES, two_axis_rig().pose(np.array(readings)))
