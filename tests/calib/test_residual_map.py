"""What every point is off by is what the quality sums up, also where readings are not what the session says."""

import numpy as np
import pytest

from benchmarks.random_rigs import looking_rig
from calib import Calibration, solve, verify
from calib.as_solved import as_solved
from calib.observations import observe
from calib.residual_map import residual_map
from calib.session import Session
from tests.calib.likelihood.test_imperfections import backlash, both_ways, rig_of_three
from tests.calib.likelihood.test_slips import slipping_session


def check_residuals(calibration: Calibration, session: Session) -> None:
    """The map's residuals are the quality's, by view."""
    shown = {view.view: view.rms_px for view in residual_map(calibration, session, observe(session))}
    stated = {view.view: view.rms_px for view in calibration.quality.views}
    assert shown == pytest.approx(stated, rel=1e-6)


def test_residuals_of_a_joint_that_slipped_are_of_where_it_stood() -> None:
    rng = np.random.default_rng(1)
    looking = looking_rig(rng, 3)
    size = 0.02 * float(np.ptp(looking.ranges[1]))
    session = slipping_session(looking, rng, [(1, 14, size)])
    calibration = solve(session)
    (slip,) = calibration.quality.slips
    assert (slip.joint, slip.view) == ("j1", 14)
    assert slip.size == pytest.approx(size, abs=4 * slip.std)
    check_residuals(calibration, session)
    plain, known = verify(calibration, session), verify(calibration, as_solved(calibration, session))
    assert known.rms_px == pytest.approx(calibration.quality.rms_px, rel=1e-6)
    assert plain.rms_px is not None
    assert known.rms_px is not None
    assert plain.rms_px > 10 * known.rms_px


def test_residuals_of_a_joint_with_play_are_of_the_side_that_the_fit_found() -> None:
    """As after homing: nobody knows from where an idle joint came."""
    session = both_ways(rig_of_three(), backlash, 1)
    idle = [view.joint != "j0" for view in session.views]
    unknown = [
        view.model_copy(update={"approached": [0, *(view.approached or [])[1:]]}) if here else view
        for view, here in zip(session.views, idle, strict=True)
    ]
    session = session.with_views(unknown)
    calibration = solve(session)
    found = [view.approached is not None for view in calibration.quality.views]
    assert found == idle
    assert all(
        view.approached == [1, *(session.views[view.view].approached or [])[1:]]
        for view in calibration.quality.views
        if view.approached
    )
    check_residuals(calibration, session)
