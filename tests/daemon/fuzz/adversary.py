"""Devices and disks that go wrong when they are told to: faults by name, and how each is undone."""

import contextlib
import dataclasses
import errno
import os
from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, cast
from unittest import mock

from calib import durable_files
from daemon.errors import StoreError
from daemon.profile import Profile
from daemon.rig import Devices, make_devices
from daemon.store.database import Database
from drivers.camera import CameraSpec, Frame
from drivers.clock import Clock
from drivers.simulated import SimulatedCamera, SimulatedController
from drivers.simulated.motion import Motion


class RepeatingCamera:
    """A simulated camera that can be made to show its latest picture again and again, whenever it is asked."""

    def __init__(self, camera: SimulatedCamera) -> None:
        self._camera = camera
        self._latest: Frame | None = None
        self.repeats = False

    @property
    def spec(self) -> CameraSpec:
        return self._camera.spec

    async def open(self) -> None:
        await self._camera.open()

    async def close(self) -> None:
        await self._camera.close()

    async def frame(self, after: float | None = None) -> Frame:
        if self._latest is None or not self.repeats:
            self._latest = await self._camera.frame(after)
        return self._latest


class Adversary:
    """The devices of a simulated rig, and all that can go wrong with them and with the disk."""

    def __init__(self, profile: Profile, clock: Clock) -> None:
        devices = make_devices(profile, clock)
        camera = cast(SimulatedCamera, devices.camera)
        self._repeating = RepeatingCamera(camera)
        self.devices: Devices = dataclasses.replace(devices, camera=self._repeating)
        self._disk = self._database = 0
        """How many of the next writes fail."""
        self.faults: dict[str, Callable[[], None]] = {
            "camera lost": lambda: camera.inject("lost"),
            "camera frozen": lambda: camera.inject("frozen"),
            "camera late": lambda: camera.inject("late"),
            "camera repeats": lambda: setattr(self._repeating, "repeats", True),
            "disk full once": lambda: self._fill(disk=1),
            "disk full": lambda: self._fill(disk=20),
            "database full once": lambda: self._fill(database=1),
            "database full": lambda: self._fill(database=20),
        }
        self.power_lost: dict[str, float] = {}
        """When the motors of each axis last lost their power, and with it where they are (rig's clock, s)."""
        self.silent_since: dict[str, float] = {}
        """Since when each axis has not been answered for (rig's clock, s)."""
        self.homings: defaultdict[str, list[Motion]] = defaultdict(list)
        """The motions of each axis to its home switch, under whichever daemon."""
        self._clock = clock
        self._repairs: list[Callable[[], None]] = [camera.repair, self._repair]
        for name, each in devices.controllers.items():
            self._list(name, cast(SimulatedController, each))

    def repair(self) -> None:
        """Undo whatever has gone wrong."""
        for repair in self._repairs:
            repair()

    @contextlib.contextmanager
    def disk(self) -> Iterator[None]:
        """Let what is written meanwhile meet the disk's faults."""
        flush, transact = durable_files.flush, Database.transact

        def flaky_flush(path: Path) -> None:
            if self._disk:
                self._disk -= 1
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
            flush(path)

        async def flaky_transact(database: Database, work: Callable[[Any], Any]) -> Any:
            if self._database:
                self._database -= 1
                raise StoreError("the database cannot be used: database or disk is full")
            return await transact(database, work)

        with (
            mock.patch.object(durable_files, "flush", flaky_flush),
            mock.patch.object(Database, "transact", flaky_transact),
        ):
            yield

    def _list(self, name: str, controller: SimulatedController) -> None:
        def goes(fault: Any) -> Callable[[], None]:
            def inject() -> None:
                controller.inject(fault)
                now = self._clock.now()
                for axis in controller.axes:
                    if fault in {"lost", "alarm"}:
                        self.power_lost[axis] = now
                    if fault in {"lost", "mute"}:
                        self.silent_since.setdefault(axis, now)

            return inject

        for fault in ("lost", "mute", "late", "alarm"):
            self.faults[f"{name} {fault}"] = goes(fault)
        for axis in controller.axes:
            self.faults[f"{axis} stalls"] = partial(controller.inject, "stall", axis)
            self.faults[f"{axis} hangs"] = partial(controller.inject, "hang", axis)
        self._repairs.append(controller.repair)

    def _fill(self, disk: int = 0, database: int = 0) -> None:
        self._disk, self._database = max(self._disk, disk), max(self._database, database)

    def _repair(self) -> None:
        self._repeating.repeats = False
        self._disk = self._database = 0
        self.silent_since.clear()
