"""The measuring half of a run: homing, sweeps and free views, each view on disk before the next move."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, cast

from calib.errors import DetectionError
from calib.session_writer import Picture, SessionWriter
from daemon.errors import TargetUnseenError
from daemon.procedure.event_log import EventLog
from daemon.procedure.events import Homing, JointStarted, Moving, Planned, Use, ViewTaken, Warned
from daemon.procedure.observation import Observation, Observer
from daemon.profile import FreeView, Sweep
from daemon.rig import Rig
from drivers.cancellation import finish

FEWEST_VIEWS = 2
"""Positions of a fit sweep at which the target must be seen: one shows no motion of the joint."""

Checkpoint = Callable[[], Awaitable[None]]


class Survey:
    """Takes all views of the profile's procedure. `checkpoint` is awaited before each position."""

    def __init__(self, rig: Rig, writer: SessionWriter, log: EventLog, checkpoint: Checkpoint) -> None:
        self._rig = rig
        self._writer = writer
        self._log = log
        self._checkpoint = checkpoint
        self._observer = Observer(rig)
        self._procedure = rig.profile.procedure
        self._positions = sum(1 for _ in self._procedure.planned_views())
        self._position = 0
        self._told: set[str] = set()  # the kinds of faults that were told of in this sweep

    async def take(self) -> None:
        """Home what is not homed, then take every view.

        Raises TargetUnseenError when a sweep is in vain, OSError when the disk does not take a view, and what
        the devices raise.
        """
        joints = list(dict.fromkeys(sweep.joint for sweep in self._procedure.sweeps))
        self._log.add(Planned(views=self._positions, joints=joints))
        for device in self._rig.snapshot.devices:
            for warning in device.warnings:
                self._log.add(Warned(message=warning))
        await self._home()
        for sweep in self._procedure.sweeps:
            await self._sweep(sweep)
        if self._procedure.views:
            await self._free_views(self._procedure.views)
        await finish(asyncio.to_thread(self._writer.complete))

    async def _home(self) -> None:
        for name in self._rig.specs:
            if not self._rig.axis(name).homed:
                await self._checkpoint()
                self._log.add(Homing(axis=name))
                await self._rig.home(name)

    async def _sweep(self, sweep: Sweep) -> None:
        await self._checkpoint()
        self._log.add(JointStarted(joint=sweep.joint, views=len(sweep.readings), use=sweep.use))
        self._told.clear()
        await self._observer.go(sweep.start)
        seen = 0
        for reading in sweep.readings:
            seen += await self._view({sweep.joint: reading}, sweep.joint, sweep.use)
        if sweep.use == "fit" and seen < FEWEST_VIEWS:
            raise TargetUnseenError(
                f"the target was found at {seen} of {len(sweep.readings)} positions of '{sweep.joint}', "
                f"and {FEWEST_VIEWS} are the fewest: see that the camera sees all of it, well lit and sharp"
            )

    async def _free_views(self, views: tuple[FreeView, ...]) -> None:
        await self._checkpoint()
        self._log.add(JointStarted(joint=None, views=len(views)))
        self._told.clear()
        for view in views:
            await self._view(view.readings, None, view.use)

    async def _view(self, targets: Mapping[str, float], joint: str | None, use: Use) -> bool:
        """Take one view; return whether the target was found."""
        await self._checkpoint()
        self._position += 1
        self._log.add(Moving(position=self._position, of=self._positions, targets=dict(targets)))
        await self._observer.go(targets)
        observation = await self._look_twice()
        if observation is None:
            return False
        await self._store(observation, joint, use)
        self._warn(observation)
        return True

    def _warn(self, observation: Observation) -> None:
        """Tell of pictures that are worse than they should be, of each kind of fault once a sweep."""
        found: dict[str, str] = {fault.kind: fault.message for fault in observation.faults if fault.spoils}
        if observation.seen.warning is not None:
            found["frames"] = observation.seen.warning
        for kind, message in found.items():
            if kind not in self._told:
                self._told.add(kind)
                where = f"position {self._position} of {self._positions}"
                self._log.add(Warned(message=f"{where} is measured all the same: {message}"))

    async def _look_twice(self) -> Observation | None:
        try:
            return await self._observer.look()
        except DetectionError:
            pass  # a picture can be spoilt by what passes by; a second one tells
        try:
            return await self._observer.look()
        except DetectionError as error:
            where = f"position {self._position} of {self._positions}"
            self._log.add(Warned(message=f"{where} is left out: {error}"))
            return None

    async def _store(self, observation: Observation, joint: str | None, use: Use) -> None:
        fields: dict[str, Any] = {"joint": joint, "use": use, **observation.view_fields()}
        # Finished even when cancelled, so that what the writer holds is what is on disk.
        pictures = [
            cast("Picture", frame.image) for frame in observation.frames
        ]  # a camera's are 8 or 16 bits
        view = await finish(asyncio.to_thread(self._writer.add_pictures, pictures, **fields))
        assert view.image is not None
        self._log.add(
            ViewTaken(
                position=self._position,
                of=self._positions,
                view=len(self._writer.session.views) - 1,
                joint=joint,
                use=use,
                readings=observation.readings,
                points=len(observation.seen.detection.ids),
                frames=observation.seen.frames,
                image=view.image,
            )
        )
