"""The daemon without its HTTP: rig, lease, store, runs and poses, opened together and closed in order."""

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from calib import Calibration
from calib.errors import CalibError
from daemon.access.access import Access, running_access
from daemon.client_motion import ClientMotions
from daemon.errors import DaemonError, StoreError
from daemon.idempotency import AnswersGiven
from daemon.judging import Judge, Sightings
from daemon.lease import LeaseDesk
from daemon.live_detection import LiveDetection
from daemon.live_picture import LivePicture
from daemon.live_view import LiveView
from daemon.operation.figures import Figures
from daemon.operation.pulse import watch_loop
from daemon.operation.store_check import StoreCheck
from daemon.pose import ActiveCalibration, Fallback, PoseService
from daemon.procedure import RunManager
from daemon.procedure.checklist import Checklist
from daemon.profile import Profile
from daemon.rig import Devices, Rig
from daemon.store import CalibrationRecord, Store
from daemon.streams import Streams

logger = logging.getLogger(__name__)


class Service:
    """One rig in operation. See `running_service`."""

    def __init__(self, profile: Profile, rig: Rig, store: Store, access: Access) -> None:
        self.profile = profile
        self.access = access
        self.rig = rig
        self.store = store
        self.store_check = StoreCheck(store)
        self.figures = Figures()
        self.leases = LeaseDesk()
        self.motions = ClientMotions(rig, self.leases)
        self.poses = PoseService(rig, self.figures.poses.inc)
        self.fallback: Fallback | None = None
        """What the active calibration was found to lack, until another is activated."""
        seen = Sightings()
        self.runs = RunManager(rig, self.leases, store, self._use, self.figures.told, seen.note)
        self.judge = Judge(store, self.runs, seen)
        self.pictures = LivePicture(rig)
        self.sightings = LiveDetection(rig)
        self.checklist = Checklist(rig, self.leases, self.runs, self.sightings, self.poses, store.folder)
        self.view = LiveView(rig, self.pictures, self.sightings)
        self.streams = Streams()
        self.answers = AnswersGiven(store.answers)
        self.started_at = datetime.now(UTC)
        self.version = version("activecam")

    async def activate(self, calibration_id: str) -> CalibrationRecord:
        """Compute poses from this calibration from now on, and after every restart.

        Raises UnknownCalibrationError, CalibrationMismatchError, FormatError and StoreError; the one that was
        active stays so then.
        """
        prepared = self._prepare(await self.store.calibration(calibration_id))
        record = await self.store.activate(calibration_id)
        self._take_over(prepared)
        return record

    async def restore(self) -> None:
        """Take up what an earlier daemon left: the active calibration, and runs that it did not finish."""
        await self.answers.restore()
        try:
            await self.runs.settle()
        except StoreError as error:
            # A full disk is no reason to serve no pose; it is done before the next run.
            logger.warning("runs that an earlier daemon left unfinished are not marked so: %s", error)
        self.fallback = await self._take_up_calibration()
        if self.fallback is not None:
            logger.warning("%s", self.fallback.sentence)

    async def halt(self) -> None:
        """End streams, motions and the run, and return when the axes stand."""
        self.streams.close()
        # Before the latch, which would fail the run rather than interrupt it.
        await self.runs.close()
        self.rig.latch.engage("the daemon is shutting down", for_good=True)
        await self.motions.close()
        self.leases.close()

    async def missing(self) -> list[str]:
        """Return sentences on what its work cannot do without.

        These are lost devices, a store that takes nothing, and a calibration that cannot be used.
        """
        sentences = [device.lost for device in self.rig.snapshot.devices if device.lost is not None]
        if self.fallback is not None:
            sentences.append(self.fallback.sentence)
        disk = await self.store_check.problem()
        return sentences if disk is None else [*sentences, disk]

    @property
    def problems(self) -> list[str]:
        """Sentences on whatever keeps the daemon from doing all of its work."""
        return self.rig.snapshot.problems + ([] if self.fallback is None else [self.fallback.sentence])

    async def _take_up_calibration(self) -> Fallback | None:
        """Compute poses from the active calibration, or from the newest before it that can be used.

        Which one is active in the store is left alone, so that every start says again what is wrong with it.
        """
        reasons: dict[str, str] = {}
        for calibration_id in await self.store.active_and_earlier():
            try:
                self.poses.activate(self._prepare(await self.store.calibration(calibration_id)))
            except (CalibError, DaemonError) as error:
                reasons[calibration_id] = str(error)
            else:
                return Fallback(reasons, calibration_id) if reasons else None
        return Fallback(reasons, None) if reasons else None

    def _use(self, record: CalibrationRecord, calibration: Calibration) -> None:
        self._take_over(self.poses.prepare(record.id, calibration))

    def _take_over(self, prepared: ActiveCalibration) -> None:
        self.poses.activate(prepared)
        self.fallback = None

    def _prepare(self, record: CalibrationRecord) -> ActiveCalibration:
        return self.poses.prepare(record.id, record.read())


@contextlib.asynccontextmanager
async def running_service(
    profile: Profile, data: Path, devices: Devices | None = None, *, keys_asked: bool = False
) -> AsyncIterator[Service]:
    """Open the rig of `profile` and what is stored in `data`; on leaving, the axes are stopped and let go.

    `devices` are the profile's own unless given; `keys_asked` is whether each request must show an API key.

    Raises StoreError, NoKeyError and OptionsError. A device that is not there is no error: it is looked for until
    it is.
    """
    async with contextlib.AsyncExitStack() as stack:
        store = await Store.open(data)
        stack.push_async_callback(store.close)
        access = await stack.enter_async_context(running_access(store, keys_asked=keys_asked))
        rig = await Rig.open(profile, devices)
        stack.push_async_callback(rig.close)
        service = Service(profile, rig, store, access)
        stack.push_async_callback(service.halt)
        pulse = asyncio.create_task(watch_loop(service.figures.loop_lag.observe), name="pulse")
        stack.callback(pulse.cancel)
        await service.restore()
        yield service
