"""The measuring half of a run: homing, sweeps and free views, each view on disk before the next move."""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

from calib.errors import CalibError, DetectionError
from calib.observations import Observation as ViewObservation
from calib.observations import observe, observed_in
from calib.second_look import partly_seen
from calib.session import Session
from calib.session_writer import Picture, SessionWriter
from daemon.errors import TargetUnseenError
from daemon.procedure.assignment import Checkpoint, Note
from daemon.procedure.event_log import EventLog
from daemon.procedure.events import Homing, JointStarted, Moving, Planned, Use, ViewTaken, Warned
from daemon.procedure.observation import Observation, Observer, Taken, find, find_where_predicted
from daemon.procedure.remarks import Remarks, Spot
from daemon.profile import FreeView, Sweep
from daemon.rig import Rig
from drivers.cancellation import finish

MOST_KEPT = 8
"""Positions of a sweep whose frames are kept to be looked at again at its end."""
FEWEST_VIEWS = 2
"""Positions of a fit sweep at which the target must be seen: one shows no motion of the joint."""


class Survey:
    """Takes the views of the profile's procedure that the session lacks.

    A session that has views already goes on after its last finished sweep, once all axes have been homed anew. Its
    `starts` say which sweeps begin elsewhere than planned.
    `checkpoint` is awaited before each position; `note` is called with what is found in each picture by itself.
    """

    def __init__(
        self, rig: Rig, writer: SessionWriter, log: EventLog, checkpoint: Checkpoint, note: Note
    ) -> None:
        self._rig = rig
        self._writer = writer
        self._log = log
        self._checkpoint = checkpoint
        self._note = note
        self._observer = Observer(rig)
        self._procedure = rig.profile.procedure.starting(writer.session.starts)
        self._positions = sum(1 for _ in self._procedure.planned_views())
        self._position = 0
        self._resumed = bool(writer.session.views or writer.session.set_aside)
        self._forgotten = bool(writer.session.views)  # what an earlier part of the run saw
        self._remarks = Remarks(log, self._positions)
        self._seen: list[ViewObservation] = []
        self._unseen: list[_Unseen] = []

    async def take(self) -> None:
        """Home what is not homed, then take every view that is missing.

        Raises TargetUnseenError when a sweep is in vain, OSError when the disk does not take a view, and what
        the devices raise.
        """
        procedure, done = self._procedure, self._writer.session.sweeps_done
        joints = list(dict.fromkeys(sweep.joint for sweep in procedure.sweeps))
        self._position = sum(len(sweep.readings) for sweep in procedure.sweeps[:done])
        self._log.add(Planned(views=self._positions, joints=joints, done=self._position))
        for device in self._rig.snapshot.devices:
            for warning in device.warnings:
                self._log.add(Warned(message=warning))
        await self._home()
        for sweep in procedure.sweeps[done:]:
            await self._sweep(sweep)
            await finish(asyncio.to_thread(self._writer.end_sweep))
        if procedure.views:
            await self._free_views(procedure.views)
        await finish(asyncio.to_thread(self._writer.complete))

    async def _home(self) -> None:
        for name in self._rig.specs:
            # What an axis says of itself may have changed with whatever cut the run off.
            if self._resumed or not self._rig.axis(name).homed:
                await self._checkpoint()
                self._log.add(Homing(axis=name))
                await self._rig.home(name)

    async def _sweep(self, sweep: Sweep) -> None:
        await self._checkpoint()
        self._log.add(JointStarted(joint=sweep.joint, views=len(sweep.readings), use=sweep.use))
        self._remarks.begin_sweep()
        await self._observer.go(sweep.start)
        seen = 0
        for reading in sweep.readings:
            seen += await self._view({sweep.joint: reading}, sweep.joint, sweep.use)
        seen += await self._look_again()
        if sweep.use == "fit" and seen < FEWEST_VIEWS:
            raise TargetUnseenError(
                f"the target was found at {seen} of {len(sweep.readings)} positions of '{sweep.joint}', "
                f"and {FEWEST_VIEWS} are the fewest: see that the camera sees all of it, well lit and sharp"
            )

    async def _free_views(self, views: tuple[FreeView, ...]) -> None:
        await self._checkpoint()
        self._log.add(JointStarted(joint=None, views=len(views)))
        self._remarks.begin_sweep()
        for view in views:
            await self._view(view.readings, None, view.use)
        await self._look_again()

    async def _view(self, targets: Mapping[str, float], joint: str | None, use: Use) -> bool:
        """Take one view; return whether the target was found."""
        await self._checkpoint()
        self._position += 1
        self._log.add(Moving(position=self._position, of=self._positions, targets=dict(targets)))
        await self._observer.go(targets)
        spot = Spot(self._position, joint, use)
        for first in (True, False):
            taken = await self._observer.take()
            try:
                observation = await asyncio.to_thread(find, taken, self._rig.profile.target)
            except DetectionError as error:
                if not first:  # a picture can be spoilt by what passes by; a second one tells
                    self._unseen.append(_Unseen(spot, taken, str(error)))
            else:
                picture = await self._store(observation, spot)
                self._note(picture, self._seen[-1])
                self._remarks.warn(observation, spot)
                return True
        if len(self._unseen) > MOST_KEPT:
            self._leave_out(self._unseen.pop(0))
        return False

    async def _look_again(self) -> int:
        """Look where the other views predict it for the target that was not found; return in how many views it is.

        A grid without numbers that is partly out of the picture is not found otherwise.
        """
        if self._unseen and self._forgotten:
            self._seen = await asyncio.to_thread(_observed_on_disk, self._writer.session)
            self._forgotten = False
        count, found = 0, True
        while found:
            found = False
            for unseen in list(self._unseen):
                session, seen = self._writer.session, list(self._seen)
                try:
                    observation = await asyncio.to_thread(_where_predicted, unseen.taken, session, seen)
                except CalibError:
                    continue
                self._unseen.remove(unseen)
                await self._store(observation, unseen.spot)
                self._remarks.tell(unseen.spot, partly_seen(observation.seen.detection, session.target))
                self._remarks.warn(observation, unseen.spot)
                count, found = count + 1, True
        while self._unseen:
            self._leave_out(self._unseen.pop(0))
        return count

    def _leave_out(self, unseen: "_Unseen") -> None:
        self._remarks.leave_out(unseen.spot, unseen.problem)

    async def _store(self, observation: Observation, spot: Spot) -> str:
        """Put a view on disk and tell of it; return its picture's name."""
        taken, detection = observation.taken, observation.seen.detection
        fields: dict[str, Any] = {
            "joint": spot.joint,
            "use": spot.use,
            "sweep": self._writer.session.sweeps_done,
            **taken.view_fields(),
        }
        pictures = [cast("Picture", frame.image) for frame in taken.frames]  # a camera's are 8 or 16 bits
        # Finished even when cancelled, so that what the writer holds is what is on disk.
        view = await finish(asyncio.to_thread(self._writer.add_pictures, pictures, **fields))
        assert view.image is not None
        place = len(self._writer.session.views) - 1
        self._seen.append(observed_in(detection, place, self._writer.session.camera_index(view)))
        self._log.add(
            ViewTaken(
                position=spot.position,
                of=self._positions,
                view=place,
                joint=spot.joint,
                use=spot.use,
                readings=taken.readings,
                points=len(detection.ids),
                frames=observation.seen.frames,
                image=view.image,
            )
        )
        return view.image


@dataclass(frozen=True, slots=True)
class _Unseen:
    """Frames in which the target was not found, and why."""

    spot: Spot
    taken: Taken
    problem: str


def _observed_on_disk(session: Session) -> list[ViewObservation]:
    """Return what is seen in the pictures of all views, those of an earlier part of the run among them."""
    try:
        return observe(session).observations
    except CalibError:
        return []


def _where_predicted(taken: Taken, session: Session, seen: list[ViewObservation]) -> Observation:
    """Find the target where the views `seen` of `session` predict it; raises CalibError."""
    from calib.prediction import (
        predicted_by_views,
    )  # it brings scipy, which a daemon that serves poses does without

    predicted = predicted_by_views(session, seen, taken.readings)
    return find_where_predicted(taken, session.target, predicted)
