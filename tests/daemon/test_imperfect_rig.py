"""A rig with play in one joint, another one that moves it along, and a plate that bulges: from pictures to poses."""

import math
from pathlib import Path

import numpy as np
import pytest

from calib import Calibration, load_session, solve, verify
from calib.session import Session
from daemon.profile import load_profile
from daemon.service import Service, running_service
from daemon.store import RunRecord, RunState
from tests.daemon.rigs import write_profile

PLAY = 0.2
COUPLING = 0.02
BULGE = 2e-3


async def finished(service: Service) -> RunRecord:
    run = await service.runs.wait((await service.runs.start()).id)
    assert run.state is RunState.SUCCEEDED, run.error
    return run


async def test_what_is_imperfect_is_found_and_poses_take_it_into_account(tmp_path: Path) -> None:
    async with running_service(load_profile(write_imperfect_rig(tmp_path)), tmp_path / "data") as service:
        session = load_session(service.store.session_folder(await finished(service)))
        assert len(session.views) == 9 + 17 + 2
        calibration = solve(session, target_warp=True)
        expect_what_is_imperfect(service, calibration, session)
        expect_predictions(calibration, session)
        await expect_poses_of_both_sides(service, calibration)


def write_imperfect_rig(folder: Path) -> Path:
    path = write_profile(folder, positions=9)
    text = path.read_text(encoding="utf-8")
    sweep = 'to = "12 deg"\npositions = 9\n'
    joint = "scale = 0.0174\n"
    assert text.count(sweep) == text.count(joint) == 1
    text = text.replace(sweep, sweep + "both_ways = true\n")
    text = text.replace(joint, f'{joint}backlash = "{PLAY} deg"\ncoupling = {{ slide = {COUPLING} }}\n')
    text += f'[simulation.plate]\nbulge = "{1e3 * BULGE} mm"\n'
    path.write_text(text, encoding="utf-8")
    return path


def expect_what_is_imperfect(service: Service, calibration: Calibration, session: Session) -> None:
    (play,) = calibration.corrections.backlash
    assert play.joint == "pan"
    assert play.half_gap_std is not None
    # The load lags behind the motor: it stands half the play below a reading that was approached from below.
    assert play.half_gap == pytest.approx(-PLAY / 2, abs=3 * play.half_gap_std)
    (along,) = calibration.corrections.coupling
    assert (along.joint, along.by) == ("pan", "slide")
    assert along.factor_std is not None
    true = COUPLING * 0.001 / 0.0174
    assert along.factor == pytest.approx(true, abs=3 * along.factor_std)
    warp = calibration.corrections.target_warp
    assert warp is not None
    assert service.rig.world is not None
    plate = service.rig.world.target_points()
    plane = np.column_stack([np.ones(len(plate)), plate[:, :2]])
    heights = plate[:, 2] - plane @ np.linalg.lstsq(plane, plate[:, 2], rcond=None)[0]
    found = calibration.points_of(session.target)[:, 2]
    assert np.abs(found - heights).max() < 0.2 * np.ptp(heights)


def expect_predictions(calibration: Calibration, session: Session) -> None:
    verdict, flat = verify(calibration, session), verify(solve(session), session)
    assert verdict.rms_px is not None
    assert flat.rms_px is not None
    assert verdict.rms_px < 0.1
    assert flat.rms_px > 1.5 * verdict.rms_px


async def expect_poses_of_both_sides(service: Service, calibration: Calibration) -> None:
    service.poses.activate(service.poses.prepare("found", calibration))
    rig, apart = service.rig, []
    assert rig.world is not None
    for target in (-5.0, 3.0, 8.0, 3.0):
        await rig.move({"slide": 40.0, "pan": target})
        standing = rig.snapshot
        pose = service.poses.active.poses(
            np.array([standing.readings], dtype=float), None, [standing.approached]
        ).world_from_camera[0]
        true = rig.world.world_from_camera_at(rig.clock.now())
        turn = np.trace(pose[:3, :3].T @ true[:3, :3])
        apart.append(math.degrees(math.acos(min((turn - 1) / 2, 1.0))))
    assert max(apart) < 0.5 * PLAY / 2
