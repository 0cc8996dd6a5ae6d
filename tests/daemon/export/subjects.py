"""Calibrations to take away: of the shipped rigs, from exact poses, and with a lens."""

from typing import Any

import numpy as np

from calib import Calibration, Session, solve
from calib.session import SESSION_FORMAT
from daemon.export import Subject
from daemon.profile import load_profile
from daemon.profile_document import ProfileDocument
from daemon.rig import make_devices

LENS = {
    "model": "opencv",
    "width": 1280,
    "height": 960,
    "fx": 1402.5,
    "fy": 1399.25,
    "cx": 641.125,
    "cy": 476.5,
    "distortion": [-0.21, 0.093, 1e-05, -0.0004, 0.0125],
}


def calibration_of(name: str, **changes: Any) -> Calibration:
    """Return the calibration of a shipped simulated rig, exact, and with `changes` to its document."""
    profile = load_profile(name)
    world = make_devices(profile).world
    assert world is not None
    joints = [axis.spec.name for axis in profile.axes]
    views = []
    for sweep in profile.procedure.sweeps:
        for value in sweep.readings:
            readings = [{**sweep.start, sweep.joint: value}.get(joint, 0.0) for joint in joints]
            pose = world.world_from_camera(readings)
            views.append({"joint": sweep.joint, "readings": readings, "world_from_camera": pose.tolist()})
    session = {
        "format": SESSION_FORMAT,
        "joints": [
            {"name": axis.spec.name, "kind": axis.spec.kind, "reading_unit": axis.spec.unit}
            for axis in profile.axes
        ],
        "cameras": [{"name": profile.camera.spec.name, "link": profile.camera.link}],
        "target": {"kind": "none"},
        "views": views,
    }
    solved = solve(Session.model_validate(session), "closed_form")
    return Calibration.model_validate(solved.model_dump(mode="json", exclude_unset=True) | changes)


def with_lens(calibration: Calibration, **changes: Any) -> Calibration:
    """Return a calibration whose first camera has a lens."""
    document = calibration.model_dump(mode="json", exclude_unset=True)
    document["cameras"][0]["intrinsics"] = {**LENS, **changes}
    return Calibration.model_validate(document)


def subject_of(calibration: Calibration, **known: Any) -> Subject:
    """Return what is taken away of a calibration."""
    document = calibration.model_dump_json(exclude_unset=True).encode()
    return Subject(calibration=calibration, document=document, **known)


def profile_document(name: str) -> dict[str, Any]:
    """Return a shipped rig's profile as it is stored with a run."""
    return ProfileDocument.of(load_profile(name)).model_dump(mode="json")


def random_readings(calibration: Calibration, count: int) -> np.ndarray:
    """Return readings (count, m) within the range of a calibration and a little beyond it."""
    low, high = np.array(calibration.range).T
    rng = np.random.default_rng(1)
    return rng.uniform(low - 0.2 * (high - low), high + 0.2 * (high - low), (count, len(low)))
