"""What there is to judge by: runs and calibrations from the store, and what was made of them."""

import asyncio
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from calib import Calibration
from calib.errors import ImageError
from calib.observations import Observation
from calib.picture_file import load_picture
from calib.scene import Scene, scene
from calib.stated_quality import CameraCoverage
from calib.targets import Target
from daemon.errors import SessionUnreadableError, UnknownCalibrationError, UnknownViewError
from daemon.jpeg import encoded
from daemon.judging.kept import Kept
from daemon.judging.sightings import Sightings
from daemon.judging.views import JudgedView, views_by_calibration, views_by_themselves
from daemon.procedure import RunManager
from daemon.procedure.measured import session_of
from daemon.procedure.worker import in_worker
from daemon.profile import Profile
from daemon.store import CalibrationRecord, Store
from drivers.camera import CameraSpec

if TYPE_CHECKING:
    from calib.comparison import Comparison
    from calib.residual_map import ViewMisses

CALIBRATIONS: Final = 8
"""Calibrations that are kept in memory."""
SCENES: Final = 64
"""Scenes, each at its readings."""
RESIDUALS: Final = 4
"""And residuals of so many."""


@dataclass(frozen=True, slots=True)
class JudgedRun:
    """A run's views, and by which calibration they are judged; None where each is by itself."""

    calibration_id: str | None
    views: Sequence[JudgedView]


@dataclass(frozen=True, slots=True)
class StoredOne:
    """A calibration as it is stored, and read. Which one is active may have changed since."""

    record: CalibrationRecord
    calibration: Calibration


class Judge:
    """Answers from disk, in worker threads; the loop has nothing to compute."""

    def __init__(self, store: Store, runs: RunManager, sightings: Sightings) -> None:
        self._store = store
        self._runs = runs
        self._sightings = sightings
        self._calibrations: Kept[str, StoredOne] = Kept(CALIBRATIONS)
        self._scenes: Kept[tuple[str, tuple[float, ...], tuple[int, ...] | None], Scene] = Kept(SCENES)
        self._residuals: Kept[str, Sequence[ViewMisses]] = Kept(RESIDUALS)

    async def views(self, run_id: str, calibration_id: str | None = None) -> JudgedRun:
        """Return a run's views as a calibration of it says of them, the run's latest unless another is named.

        Raises UnknownRunError, UnknownCalibrationError, SessionUnreadableError, FormatError and StoreError.
        """
        run = await self._runs.get(run_id)
        session = await asyncio.to_thread(session_of, run, self._store.session_folder(run))
        if session is None:
            return JudgedRun(None, [])
        # A run that is taken up again may give a number to another view than its calibration knows by it.
        found = calibration_id or (run.calibration_id if session.complete or run.state.over else None)
        if found is None:
            observed = await self._sightings.of(run_id, session)
            return JudgedRun(None, await in_worker(lambda: views_by_themselves(session, observed)))
        stored = await self.calibration(found)
        if stored.record.run_id != run_id:
            raise UnknownCalibrationError(
                f"calibration '{found}' is of run '{stored.record.run_id}', and not of '{run_id}'"
            )
        events = await self._runs.told(run_id)
        return JudgedRun(found, views_by_calibration(session, stored.calibration, events))

    async def coverage(self, run_id: str, profile: Profile) -> CameraCoverage:
        """Return how a run's views cover the picture of the camera of `profile`, which took them.

        Raises UnknownRunError, SessionUnreadableError and StoreError.
        """
        run = await self._runs.get(run_id)
        session = await asyncio.to_thread(session_of, run, self._store.session_folder(run))
        seen = [] if session is None else (await self._sightings.of(run_id, session)).observations
        target = profile.target if session is None else session.target
        return await in_worker(lambda: _coverage(profile.camera.spec, target, seen))

    async def picture(self, run_id: str, number: int) -> Path:
        """Return where a view's picture is; raises UnknownRunError, UnknownViewError, SessionUnreadableError."""
        run = await self._runs.get(run_id)
        folder = self._store.session_folder(run)
        session = await asyncio.to_thread(session_of, run, folder)
        count = 0 if session is None else len(session.views)
        if session is None or number >= count:
            raise UnknownViewError(f"there is no view {number}: this run has {count}, counted from 0")
        return folder / (session.views[number].image or "")

    async def jpeg(self, picture: Path, width: int | None) -> bytes:
        """Return a picture as JPEG, no wider than `width` px; raises SessionUnreadableError."""
        try:
            return await asyncio.to_thread(lambda: encoded(load_picture(picture), width))
        except ImageError as error:
            raise SessionUnreadableError(str(error)) from error

    async def residuals(self, calibration_id: str) -> "Sequence[ViewMisses]":
        """Return what every point of every view is off by; raises as `views` does, and CalibError."""
        stored = await self.calibration(calibration_id)

        async def work() -> "Sequence[ViewMisses]":
            from calib.residual_map import residual_map  # it brings the solver, as `own_fit` does

            run = await self._runs.get(stored.record.run_id or "")
            session = await asyncio.to_thread(session_of, run, self._store.session_folder(run))
            if session is None:
                raise SessionUnreadableError(f"run '{run.id}' has no views on disk any more")
            observed = await self._sightings.of(run.id, session)
            return await in_worker(lambda: residual_map(stored.calibration, session, observed))

        return await self._residuals.of(calibration_id, work)

    async def scene(
        self, calibration_id: str, readings: Sequence[float], approached: Sequence[int] | None = None
    ) -> Scene:
        """Return the rig in 3-D at `readings`; raises as `calibration` does, and ReadingsError."""
        stored = await self.calibration(calibration_id)

        async def work() -> Scene:
            return await asyncio.to_thread(scene, stored.calibration, readings, approached)

        sides = None if approached is None else tuple(approached)
        return await self._scenes.of((calibration_id, tuple(readings), sides), work)

    async def comparison(self, calibration_id: str, other_id: str) -> "Comparison":
        """Return what the second has otherwise than the first; raises as `calibration` does, and CalibError."""
        from calib.comparison import compare

        first, second = await self.calibration(calibration_id), await self.calibration(other_id)
        return await in_worker(lambda: compare(first.calibration, second.calibration))

    async def calibration(self, calibration_id: str) -> "StoredOne":
        """Return a calibration, read; raises UnknownCalibrationError, FormatError and StoreError."""

        async def work() -> StoredOne:
            record = await self._store.calibration(calibration_id)
            return StoredOne(record, await asyncio.to_thread(record.read))

        return await self._calibrations.of(calibration_id, work)


def _coverage(camera: CameraSpec, target: Target, seen: Sequence[Observation]) -> CameraCoverage:
    from calib.coverage import coverage, missing_in_words  # it brings detection, which poses do without

    covered = coverage(target, (camera.width, camera.height), seen)
    return CameraCoverage(camera=camera.name, missing=missing_in_words(covered), **asdict(covered))
