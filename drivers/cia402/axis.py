"""An axis that a CiA 402 drive moves."""

from collections.abc import Callable
from typing import Final, Literal

from drivers.axis import AxisSpec, AxisState
from drivers.cia402 import objects
from drivers.cia402.drive import Drive
from drivers.cia402.link import Network
from drivers.cia402.options import Cia402AxisOptions
from drivers.cia402.sampling import Sample
from drivers.cia402.setup import set_up
from drivers.cia402.statusword import (
    ACKNOWLEDGED,
    DISABLE_VOLTAGE,
    ENABLE,
    HALT,
    HOMING,
    IMMEDIATELY,
    LIMIT_ACTIVE,
    MODE_ERROR,
    NEW_SET_POINT,
    PROFILE_POSITION,
    QUICK_STOP,
    RESET_FAULT,
    TARGET_REACHED,
    TOWARDS_ENABLED,
    State,
)
from drivers.cia402.units import Scales
from drivers.clock import Clock
from drivers.errors import DeviceFaultError, DeviceTimeoutError
from drivers.supervised import SupervisedAxis

_RESPONSE: Final = 2.0
"""Seconds that a drive may take to change its state, to take a set-point, or to begin what it was told."""
_GRACE: Final = 0.5
"""Seconds after which a bit that should have dropped and stands is taken for a new one."""
_STILL: Final = 0.1
"""An axis stands while it would take longer than this (s) to leave its tolerance."""

Doing = Literal["nothing", "homing", "positioning", "halting"]


class Cia402Axis(SupervisedAxis):
    """One axis of a `Cia402Controller`.

    A halted drive goes on to its old target as soon as halt is taken away. So halt stays until the controlword
    that gives the next set-point, and gives it `IMMEDIATELY`, or starts homing.
    """

    def __init__(self, spec: AxisSpec, options: Cia402AxisOptions, drive: Drive, clock: Clock) -> None:
        super().__init__(spec, clock)
        self._options = options
        self._drive = drive
        self._scales = Scales(1.0, 1.0, 1.0)
        self._homed = options.absolute
        self._fault: str | None = None
        self._doing: Doing = "nothing"

    def configure(self, network: Network) -> None:
        """Connect the drive and set it up, in the link's thread; moves nothing.

        Raises DeviceLostError, and OptionsError where drive and profile do not fit each other.
        """
        self._homed, self._fault, self._doing = self._options.absolute, None, "nothing"
        self._drive.connect(network)
        self._scales = set_up(self._drive.values, self._spec, self._options)

    async def read(self) -> AxisState:
        """Ask the drive; see `drivers.axis.Axis`."""
        sample = await self._drive.sample()
        fault = await self._fault_of(sample)
        position = self._reading(sample) if self._homed else None
        return AxisState(position, sample.timestamp, not self._is_still(sample), self._homed, fault)

    async def home(self) -> None:
        """Clear a fault, enable the drive and let it find its zero; see `drivers.axis.Axis`.

        A drive with an absolute encoder has nothing to find, and does not move.
        """
        await super().home()
        self._homed = True

    async def stop(self) -> None:
        """Halt; where that does not help, quick-stop, and then switch the motor off."""
        try:
            await super().stop()
        except DeviceTimeoutError:
            for controlword in (QUICK_STOP, DISABLE_VOLTAGE):
                await self._drive.force(controlword)
                if await self._standstill(self._clock.now() + self._spec.move_time(0.0)):
                    return
            raise

    async def _begin_homing(self) -> None:
        permit = self._begin("homing")
        self._homed = self._options.absolute
        await self._reset_fault(permit)
        await self._enable(permit)
        if self._options.absolute:
            self._doing = "nothing"
            return
        await self._enter(HOMING, permit)
        outcome = ACKNOWLEDGED | MODE_ERROR
        stale = (await self._drive.sample()).has(outcome)
        await self._drive.command(ENABLE | NEW_SET_POINT, permit)
        if stale:
            await self._wait(lambda sample: not sample.has(outcome), permit, _GRACE)
        begun = await self._wait(lambda sample: sample.has(outcome) or not sample.has(TARGET_REACHED), permit)
        if not begun:
            raise self._handshake_failed("does not begin to home (status bits 10 and 12)")

    async def _begin_move(self, target: float) -> None:
        permit = self._begin("positioning")
        await self._go(round(target * self._scales.position), permit)

    async def _begin_jog(self, distance: float) -> None:
        permit = self._begin("positioning")
        start = (await self._drive.sample()).position
        await self._go(start + round(distance * self._scales.position), permit)

    async def _halt(self) -> None:
        self._doing = "halting"
        await self._drive.halt()

    async def _stands(self) -> bool:
        sample = await self._drive.sample()
        still = self._is_still(sample)
        if self._doing == "halting":
            # With halt commanded, bit 10 says that the axis stands.
            return still and (sample.state is not State.ENABLED or sample.has(TARGET_REACHED))
        await self._require_no_fault(sample)
        if self._doing == "nothing":
            return still
        self._require_enabled(sample)
        if sample.has(MODE_ERROR):
            raise await self._mode_error()
        if self._doing == "homing" and not sample.has(ACKNOWLEDGED):
            return False
        return still and sample.has(TARGET_REACHED)

    async def _where(self) -> float:
        return self._reading(await self._drive.sample())

    def _homing_time(self) -> float:
        return self._options.homing_time

    def _begin(self, doing: Doing) -> int:
        """Begin a motion, at the very time at which it was found that no stop had come."""
        self._doing = doing
        return self._drive.begin()

    async def _reset_fault(self, permit: int) -> None:
        await self._wait(lambda sample: sample.state is not State.FAULT_REACTION, permit, in_fault=True)
        if (await self._drive.sample()).state is not State.FAULT:
            return
        # It is the rising edge of the bit that resets.
        await self._drive.command(DISABLE_VOLTAGE, permit)
        await self._drive.sample()
        await self._drive.command(RESET_FAULT, permit)
        if not await self._wait(lambda sample: sample.state is not State.FAULT, permit, in_fault=True):
            raise DeviceFaultError(
                f"axis '{self._spec.name}': {await self._drive.reason()}, and it cannot be reset: "
                "clear what caused it, or switch the drive off and on again"
            )

    async def _enable(self, permit: int) -> None:
        until = self._clock.now() + _RESPONSE
        while (sample := await self._drive.sample()).state is not State.ENABLED:
            await self._require_no_fault(sample)
            if self._clock.now() >= until:
                raise DeviceTimeoutError(
                    f"axis '{self._spec.name}': the drive does not enable its motor, it stays "
                    f"'{sample.state.value}': check its motor supply, its enable input and its safe-torque-off"
                )
            controlword = TOWARDS_ENABLED.get(sample.state)
            if controlword is not None:
                await self._drive.command(controlword, permit)
            await self._clock.sleep(self._poll)

    async def _enter(self, mode: int, permit: int) -> None:
        """Bring the drive into a mode, with halt set and bit 4 low, ready for its rising edge."""
        await self._drive.command(HALT, permit)
        if await self._drive.get(objects.MODE_DISPLAY) == mode:
            return
        await self._drive.set(objects.MODE, mode)
        until = self._clock.now() + _RESPONSE
        while (shown := await self._drive.get(objects.MODE_DISPLAY)) != mode:
            if self._clock.now() >= until:
                raise DeviceFaultError(
                    f"axis '{self._spec.name}': the drive stays in mode {shown} and was told to go into mode "
                    f"{mode}: check with its own tool whether it supports that mode"
                )
            await self._clock.sleep(self._poll)

    async def _go(self, counts: int, permit: int) -> None:
        await self._enable(permit)
        await self._enter(PROFILE_POSITION, permit)
        acknowledges = self._options.acknowledges
        if acknowledges and not await self._wait(lambda sample: not sample.has(ACKNOWLEDGED), permit):
            raise self._handshake_failed("still acknowledges the last set-point (status bit 12)")
        await self._drive.set(objects.TARGET, counts)
        await self._drive.command(ENABLE | IMMEDIATELY | NEW_SET_POINT, permit)
        if not acknowledges:
            # Bit 10 is of the last motion until it drops, which it need not do for a motion of no length.
            await self._wait(lambda sample: not sample.has(TARGET_REACHED), permit, _GRACE)
            await self._drive.command(ENABLE | IMMEDIATELY, permit)
            return
        if not await self._wait(lambda sample: sample.has(ACKNOWLEDGED), permit):
            beyond = (await self._drive.sample()).has(LIMIT_ACTIVE)
            raise self._handshake_failed(
                "refuses the set-point: a limit of its own is active (status bit 11)"
                if beyond
                else "does not acknowledge the set-point (status bit 12): if it never does, "
                "set 'acknowledges = false' in the axis's options"
            )
        await self._drive.command(ENABLE | IMMEDIATELY, permit)
        if not await self._wait(lambda sample: not sample.has(ACKNOWLEDGED), permit):
            raise self._handshake_failed("does not take back its acknowledgement (status bit 12)")

    async def _wait(
        self,
        until: Callable[[Sample], bool],
        permit: int,
        time: float = _RESPONSE,
        *,
        in_fault: bool = False,
    ) -> bool:
        """Wait until a sample is as wanted; return False where it is not in `time` (s).

        Raises MotionStoppedError, and DeviceFaultError where the drive is not enabled, unless it may be `in_fault`.
        """
        end = self._clock.now() + time
        while True:
            late = self._clock.now() >= end
            if until(sample := await self._drive.sample()):
                return True
            self._drive.require_permit(permit)
            if not in_fault:
                await self._require_no_fault(sample)
                self._require_enabled(sample)
            if late:
                return False
            await self._clock.sleep(self._poll)

    async def _fault_of(self, sample: Sample) -> str | None:
        if sample.state not in {State.FAULT, State.FAULT_REACTION}:
            self._fault = None
        elif self._fault is None:
            self._fault = await self._drive.reason()
            self._homed = self._options.absolute
        return self._fault

    async def _require_no_fault(self, sample: Sample) -> None:
        fault = await self._fault_of(sample)
        if fault is not None:
            raise DeviceFaultError(
                f"axis '{self._spec.name}': {fault}: clear what caused it and home the axis"
            )

    def _require_enabled(self, sample: Sample) -> None:
        if sample.state is not State.ENABLED:
            raise DeviceFaultError(
                f"axis '{self._spec.name}': the drive left its motion by itself and is "
                f"'{sample.state.value}': check its motor supply, its enable input and its safe-torque-off"
            )

    async def _mode_error(self) -> DeviceFaultError:
        # A drive that says so is mostly about to go into fault, and then tells why.
        await self._drive.halt()
        until = self._clock.now() + _GRACE
        while (
            fault := await self._fault_of(await self._drive.sample())
        ) is None and self._clock.now() < until:
            await self._clock.sleep(self._poll)
        what = "homing failed" if self._doing == "homing" else "it does not follow its set-points"
        return DeviceFaultError(
            f"axis '{self._spec.name}': {what} (status bit 13){'' if fault is None else f', {fault}'}: "
            "clear the way, check its switches, and home it again"
        )

    def _handshake_failed(self, how: str) -> DeviceTimeoutError:
        return DeviceTimeoutError(f"axis '{self._spec.name}': the drive {how}; the axis was not moved")

    def _reading(self, sample: Sample) -> float:
        return sample.position / self._scales.position

    def _is_still(self, sample: Sample) -> bool:
        return abs(sample.velocity) / self._scales.velocity * _STILL <= self._spec.tolerance
