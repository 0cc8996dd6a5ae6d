"""The measuring half of a run: homing, sweeps and free views, each view on disk before the next move."""

import asyncio
from collections.abc import Mapping
from typing import Any, cast

from calib.errors import DetectionError
from calib.observations import Observation as ViewObservation
from calib.observations import observed_in
from calib.session_writer import Picture, SessionWriter
from daemon.errors import TargetUnseenError
from daemon.procedure.assignment import Checkpoint, Note
from daemon.procedure.event_log import EventLog
from daemon.procedure.events import Homing, JointStarted, Moving, Planned, Use, ViewTaken, Warned
from daemon.procedure.observation import Observation, Observer, find
from daemon.procedure.remarks import Remarks, Spot
from daemon.procedure.unseen import Unseen
from daemon.profile import FreeView, Sweep
from daemon.rig import Rig
from drivers.cancellation import finish

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
        self._remarks = Remarks(log, self._positions)
        self._unseen = Unseen(writer, self._remarks)

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
        seen += await self._unseen.look_again(self._store)
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
        await self._unseen.look_again(self._store)

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
                    self._unseen.keep(spot, taken, str(error))
            else:
                self._note(*await self._store(observation, spot))
                self._remarks.warn(observation, spot)
                return True
        return False

    async def _store(self, observation: Observation, spot: Spot) -> tuple[str, ViewObservation]:
        """Put a view on disk and tell of it; return its picture's name, and what is seen in it."""
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
        seen = observed_in(detection, place, self._writer.session.camera_index(view))
        self._unseen.know(seen)
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
        return view.image, seen
