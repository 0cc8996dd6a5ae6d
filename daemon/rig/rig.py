"""The rig: every axis and the camera, as one thing that moves, stands, and knows where it is."""

import asyncio
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from typing import Self

from daemon.broadcast import Broadcast
from daemon.errors import StaleReadingError, StandstillError, UnknownAxisError
from daemon.operation.log_fields import log_fields
from daemon.profile import Profile
from daemon.rig.camera_owner import CameraOwner
from daemon.rig.controller_owner import Action, ControllerOwner, Permit, freely
from daemon.rig.devices import Devices, make_devices
from daemon.rig.history import PastReadings, ReadingHistory
from daemon.rig.snapshot import AxisSnapshot, RigSnapshot
from daemon.rig.stop_latch import StopLatch
from daemon.rig.utc import UtcClock
from daemon.rig.wording import because, unconfirmed
from drivers.axis import AxisController, AxisSpec
from drivers.camera import Frame
from drivers.cancellation import finish
from drivers.errors import DeviceLostError, NotHomedError


class Rig:
    """The devices of one profile, each with its owner task, from `open` to `close`.

    Positions, targets and distances are in each axis's reading unit. `snapshot` is the latest state of all
    axes; `changed` fires whenever it is replaced; `utc` turns its time stamps into UTC. A motion returns when
    the axes stand at its end; cancelling it stops the axes first. Its `permit` is asked just before each command is
    sent, and what it raises is raised. No method resends a motion.
    """

    def __init__(self, profile: Profile, devices: Devices) -> None:
        self.profile = profile
        self.clock = devices.clock
        self.world = devices.world
        self.specs: dict[str, AxisSpec] = {axis.spec.name: axis.spec for axis in profile.axes}
        self.latch = StopLatch()
        self.changed = Broadcast()
        self._pace = 1.0 if profile.simulation is None else profile.simulation.time_scale
        self.utc = UtcClock(self.clock, self._pace)
        self._controllers = [
            ControllerOwner(
                name,
                controller,
                self._specs_of(controller),
                self.latch,
                self._publish,
            )
            for name, controller in devices.controllers.items()
        ]
        self._owner_of = {axis: owner for owner in self._controllers for axis in owner.axes}
        self._camera = CameraOwner(
            profile.camera.spec.name, devices.camera, profile.procedure.frame_timeout, self._publish
        )
        self._history = ReadingHistory(
            self.specs.values(), self.utc, self._pace, profile.procedure.max_reading_age
        )
        self._tasks: list[asyncio.Task[None]] = []
        self.snapshot = self._compose()

    @classmethod
    async def open(cls, profile: Profile, devices: Devices | None = None) -> Self:
        """Make the profile's devices, unless given, and try to connect each of them once; moves nothing.

        A device that is not there is stated in the snapshot, and looked for until it is.
        Raises OptionsError where a driver cannot do what the profile asks.
        """
        rig = cls(profile, make_devices(profile) if devices is None else devices)
        owners = [*rig._controllers, rig._camera]
        for owner in owners:
            with log_fields(device=owner.name):
                rig._tasks.append(asyncio.create_task(owner.run(), name=f"owner of {owner.name}"))
        try:
            for owner in owners:
                await owner.attempted.wait()
        except asyncio.CancelledError:
            await rig.close()
            raise
        rig._publish()
        return rig

    @property
    def hung(self) -> list[str]:
        """Sentences on drivers that do not come back from what they were asked to do."""
        return [owner.hung for owner in (*self._controllers, self._camera) if owner.hung is not None]

    @property
    def tasks(self) -> "Sequence[asyncio.Task[None]]":
        """What keeps the devices connected; none of them ends before `close`, unless by an error of the program."""
        return tuple(self._tasks)

    async def close(self) -> None:
        """Stop all axes, wait until they stand, and let the devices go, even while being cancelled."""
        self.latch.engage("the daemon is shutting down", for_good=True)
        await finish(self._close())

    def age(self, snapshot: RigSnapshot) -> float | None:
        """Return how old the readings are in seconds of life, None before the first.

        A simulated rig's clock may run faster than life, but a link that has gone quiet does not.
        """
        timestamp = snapshot.timestamp
        return None if timestamp is None else (self.clock.now() - timestamp) / self._pace

    def axis(self, name: str) -> AxisSnapshot:
        """Return what is known of one axis; raises UnknownAxisError."""
        self._require_known(name)
        return self.snapshot.axis(name)

    def check_move(self, targets: Mapping[str, float]) -> None:
        """Raise what `move` would raise before anything moves."""
        for name in targets:
            self._require_known(name)
        for name, target in targets.items():
            self.specs[name].check_target(target)
        self._require_ready(targets)
        for name in targets:
            self._require_homed(name)

    def check_home(self, name: str) -> None:
        """Raise what `home` would raise before anything moves."""
        self._require_known(name)
        self._require_ready([name])

    def check_jog(self, name: str, distance: float) -> None:
        """Raise what `jog` would raise before anything moves."""
        self._require_known(name)
        axis = self.snapshot.axis(name)
        self.specs[name].check_jog(distance, axis.position if axis.homed else None)
        self._require_ready([name])

    async def move(self, targets: Mapping[str, float], permit: Permit = freely) -> None:
        """Move several axes at once, each to its target, and return when all of them stand there.

        The limits of all of them are checked, and all must be homed, before any of them moves. When one of
        them fails, the others are stopped.
        Before anything moves, raises UnknownAxisError, LimitError, NotHomedError, StopLatchedError,
        AxisBusyError and DeviceLostError; after that, what `Axis.move` raises.
        """
        self.check_move(targets)
        await self._together({name: _move_to(target) for name, target in targets.items()}, permit)

    async def home(self, name: str, permit: Permit = freely) -> None:
        """Home one axis; raises as `move` does."""
        self.check_home(name)
        await self._owner_of[name].home(name, permit)

    async def jog(self, name: str, distance: float, permit: Permit = freely) -> None:
        """Move one axis by `distance`, homed or not; raises as `move` does."""
        self.check_jog(name, distance)
        await self._owner_of[name].carry_out(name, lambda axis: axis.jog(distance), permit)

    def call_off(self, names: Iterable[str]) -> None:
        """Cancel the motions of these axes at once: none of them sends a command any more but its stop."""
        for name in names:
            self._owner_of[name].call_off(name)

    async def stop(self, reason: str) -> None:
        """Latch, stop everything at once past every motion and queue, and return when all axes stand.

        It is finished even if the caller is cancelled. Raises StandstillError naming the axes that could not
        be confirmed to stand; the latch is engaged all the same.
        """
        self.latch.engage(reason)
        self._publish()
        await self.stop_axes(list(self.specs))

    async def stop_axes(self, names: Sequence[str]) -> None:
        """Stop some axes without latching, and return when they stand; raises as `stop` does."""
        for name in names:
            self._require_known(name)
        await finish(self._stop_axes(names))

    def acknowledge_stop(self) -> None:
        """Let the rig move again after a stop."""
        self.latch.acknowledge()
        self._publish()

    async def fresh_snapshot(self, after: float) -> RigSnapshot:
        """Return a snapshot whose readings were all taken at or after `after` (rig's clock, s).

        Raises DeviceLostError when an axis's device is lost meanwhile.
        """
        while True:
            snapshot = self.snapshot
            for axis in snapshot.axes:
                if axis.lost is not None:
                    raise DeviceLostError(because(f"axis '{axis.spec.name}'", "cannot be read", axis.lost))
            if snapshot.timestamp is not None and snapshot.timestamp >= after:
                return snapshot
            for axis in snapshot.axes:
                # Those alone that are behind: the others would be read without a pause until a late one answers.
                if axis.timestamp is None or axis.timestamp < after:
                    self._owner_of[axis.spec.name].poll_soon()
            await self.changed.wait()

    async def past_readings(self, times: Sequence[datetime]) -> PastReadings:
        """Return what the readings were at `times`; of a time just passed, as soon as the axes are read again.

        Raises TimeNotCoveredError; DeviceLostError and StaleReadingError when they cannot be read again.
        """
        stamps = [self.utc.stamp(time) for time in times]
        latest = max(stamps)
        if self.snapshot.timestamp is None or self.snapshot.timestamp < latest:
            allowed = self.profile.procedure.max_reading_age
            try:
                async with asyncio.timeout(allowed):
                    await self.fresh_snapshot(latest)
            except TimeoutError:
                raise StaleReadingError(
                    f"there was no reading for {allowed:g} s: check that the axes answer"
                ) from None
        return self._history.at(stamps)

    async def frame(self, after: float | None = None) -> Frame:
        """Return the camera's newest frame exposed at or after `after` (rig's clock, s).

        Raises DeviceLostError, DeviceTimeoutError.
        """
        return await self._camera.frame(after)

    def _specs_of(self, controller: AxisController) -> dict[str, AxisSpec]:
        return {name: self.specs[name] for name in controller.axes}

    def _compose(self) -> RigSnapshot:
        return RigSnapshot(
            axes=tuple(self._owner_of[name].snapshot(name) for name in self.specs),
            devices=(*(owner.device for owner in self._controllers), self._camera.device),
        )

    def _publish(self) -> None:
        self.utc.check()
        self.snapshot = self._compose()
        self._history.note(self.snapshot.axes)
        self.changed.fire()

    def _require_known(self, name: str) -> None:
        if name not in self.specs:
            raise UnknownAxisError(f"there is no axis '{name}': this rig has {', '.join(self.specs)}")

    def _require_ready(self, names: Sequence[str] | Mapping[str, float]) -> None:
        self.latch.require_free()
        for name in names:
            self._owner_of[name].require_idle(name)

    def _require_homed(self, name: str) -> None:
        axis = self.snapshot.axis(name)
        if not axis.homed or axis.position is None:
            why = "" if axis.fault is None else f" ({axis.fault})"
            raise NotHomedError(f"axis '{name}' is not homed{why}: home it before moving it to a position")

    async def _together(self, actions: Mapping[str, Action], permit: Permit) -> None:
        try:
            async with asyncio.TaskGroup() as motions:
                for name, action in actions.items():
                    motions.create_task(self._owner_of[name].carry_out(name, action, permit))
        except BaseExceptionGroup as failures:
            # The first failure is the cause; the others are axes that were stopped because of it.
            raise failures.exceptions[0] from None

    async def _stop_axes(self, names: Sequence[str]) -> None:
        groups = [(owner, [name for name in owner.axes if name in names]) for owner in self._controllers]
        answers = await asyncio.gather(*(owner.stop(axes) for owner, axes in groups if axes))
        # Axes of one device often have one reason; a driver's names its axis itself.
        reasons = list(dict.fromkeys(reason for answer in answers for reason in answer.values()))
        if reasons:
            raise StandstillError(unconfirmed(reasons), reasons)

    async def _close(self) -> None:
        for owner in self._controllers:
            if owner.lost is None:
                await owner.stop(owner.axes)
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)


def _move_to(target: float) -> Action:
    return lambda axis: axis.move(target)
