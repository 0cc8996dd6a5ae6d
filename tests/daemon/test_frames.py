"""Several frames a view, on a simulated rig: stored, averaged with the variance measured, and shaking told of."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from calib import Calibration, load_calibration, load_session, solve
from calib.observations import observe
from calib.session import Session
from daemon.procedure.events import ViewTaken, Warned
from daemon.profile import Profile, load_profile
from daemon.service import running_service
from daemon.store import RunState
from tests.daemon.rigs import write_profile

FRAMES = 4


def noisy_rig(folder: Path, frames: int, swing: str) -> Profile:
    folder.mkdir()
    path = write_profile(folder)
    text = path.read_text(encoding="utf-8")
    text = text.replace('settle = "100 ms"', f'settle = "100 ms"\nframes = {frames}')
    text = text.replace("scale = 0.001\n", f"scale = 0.001\n{swing}\n")
    path.write_text(text + "noise = 12.0\n", encoding="utf-8")
    return load_profile(path)


async def run(
    folder: Path, frames: int, swing: str = ""
) -> tuple[Session, Calibration, list[ViewTaken], list[str]]:
    """Return a run's session, calibration, views and warnings; `swing` is its slide's."""
    async with running_service(noisy_rig(folder, frames, swing), folder / "data") as service:
        record = await service.runs.wait((await service.runs.start()).id)
        assert record.state is RunState.SUCCEEDED, record.error
        events = [event async for event in service.runs.events(record.id)]
        where = service.store.session_folder(record)
    views = [event for event in events if isinstance(event, ViewTaken)]
    warnings = [event.message for event in events if isinstance(event, Warned)]
    return load_session(where), load_calibration(where / "calibration.json"), views, warnings


def claimed(session: Session) -> float:
    """Return how far the session's points are claimed to scatter (rms, px)."""
    covariances = [o.covariances for o in observe(session).observations if o.covariances is not None]
    return float(np.sqrt(np.trace(np.concatenate(covariances), axis1=1, axis2=2).mean()))


async def test_more_frames_are_less_noise_and_the_session_has_them_all(tmp_path: Path) -> None:
    one, alone, _, _ = await run(tmp_path / "one", 1)
    several, together, views, warnings = await run(tmp_path / "several", FRAMES)

    assert alone.quality.noise_px is not None
    assert together.quality.noise_px is not None
    assert together.quality.noise_px == pytest.approx(alone.quality.noise_px / np.sqrt(FRAMES), rel=0.25)
    assert claimed(one) == pytest.approx(alone.quality.noise_px, rel=0.15)
    assert claimed(several) == pytest.approx(together.quality.noise_px, rel=0.15)

    assert not warnings
    assert [view.frames for view in views] == [FRAMES] * 10
    for view in several.views:
        assert len(view.frames) == FRAMES
        pictures = [cv2.imread(str(several.folder / name)) for name in view.frames]
        assert len({picture.tobytes() for picture in pictures}) == FRAMES
    assert solve(several).model_dump()["joints"] == together.model_dump()["joints"]


async def test_a_rig_that_still_swings_is_told_of(tmp_path: Path) -> None:
    swing = 'settling = { amplitude = "0.6 mm", frequency = "8 Hz", damping = 0.001 }'
    session, calibration, _, warnings = await run(tmp_path / "rig", FRAMES, swing)
    told = [message for message in warnings if f"between its {FRAMES} frames the picture moved by" in message]
    assert told
    assert told[0].startswith("position ")
    again = [message for message in calibration.quality.warnings if "the picture moved by" in message]
    assert again
    assert again[0].startswith(f"view 0 ({session.views[0].image}): between its {FRAMES} frames")
    # The swing is common to a view's points, and is not taken for their noise.
    assert claimed(session) < 0.05
