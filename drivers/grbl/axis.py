"""One axis of a Grbl controller."""

from drivers.axis import AxisSpec, AxisState
from drivers.clock import Clock
from drivers.grbl.machine import Machine
from drivers.grbl.options import GrblAxisOptions, GrblOptions
from drivers.supervised import SupervisedAxis


class GrblAxis(SupervisedAxis):
    """Moves by jogs, which a stop ends cleanly, and believes only standstills that were asked for after them."""

    def __init__(
        self,
        spec: AxisSpec,
        options: GrblAxisOptions,
        controller: GrblOptions,
        machine: Machine,
        clock: Clock,
    ) -> None:
        super().__init__(spec, clock, turn=machine.turn, poll=0.0)  # reports come no faster than they may
        self._zero = options.zero(spec)
        self._machine = machine
        self._homings_before = 0
        self._homing_timeout = controller.homing_timeout

    async def read(self) -> AxisState:
        """Ask the controller. The time is that of the question: the reading was taken then or after it."""
        name = self._spec.name
        report, asked_at = await self._machine.report()
        homed = name in self._machine.homed
        homing = self._machine.homing is not None
        moving = self._machine.is_moving(name) if homing else report.moving
        return AxisState(
            await self._where() if homed else None,
            asked_at,
            moving and not self._machine.others_move(name),
            homed,
            self._machine.fault(report),
        )

    async def home(self) -> None:
        """Find the axis's zero; where the controller can only home all of its axes, it homes all of them."""
        self._homings_before = self._machine.homings
        await super().home()

    async def _begin_homing(self) -> None:
        if self._spec.name in self._machine.homed and self._machine.homings != self._homings_before:
            return  # done together with an axis that was before it
        self._machine.begin_homing(self._spec.name)

    async def _begin_move(self, target: float) -> None:
        await self._machine.jog(self._spec.name, "G53G90", target - self._zero, self._spec.velocity)

    async def _begin_jog(self, distance: float) -> None:
        await self._machine.jog(self._spec.name, "G91", distance, self._spec.velocity)

    async def _halt(self) -> None:
        if not self._machine.others_move(self._spec.name):
            await self._machine.halt()

    async def _stands(self) -> bool:
        if self._machine.others_move(self._spec.name):
            await self._machine.report()  # which tells whether it is still there
            return True
        if not self._machine.homing_is_over():
            await self._clock.sleep(0.02)
            return False
        report, _ = await self._machine.report()
        return not report.moving

    async def _where(self) -> float | None:
        position = self._machine.position(self._spec.name)
        return None if position is None else position + self._zero

    async def _check_arrival(self, target: float | None) -> None:
        self._machine.require_no_restart(self._spec.name)
        await super()._check_arrival(target)

    def _homing_time(self) -> float:
        return self._homing_timeout
