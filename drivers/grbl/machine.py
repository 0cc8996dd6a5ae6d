"""The controller behind the axes: what it is told, who moves, who is homed, and what is wrong with it."""

import asyncio
import contextlib
import logging
from collections.abc import Mapping, Sequence
from typing import Final

from drivers.axis import AxisSpec
from drivers.clock import Clock
from drivers.errors import DeviceFaultError, DeviceLostError, DriverError, LimitError
from drivers.grbl import words
from drivers.grbl.link import FEED_HOLD, RESET, Link, RefusedError, RestartedError
from drivers.grbl.options import LETTERS, GrblAxisOptions, GrblOptions
from drivers.grbl.settings import differences, parse_settings, remarks
from drivers.grbl.status import Report
from drivers.grbl.wire import JOG_CANCEL

logger = logging.getLogger(__name__)

_IDENTIFY: Final = 3
"""How often a controller is asked who it is, if it restarts meanwhile."""
_REPORTS: Final = 40
"""Reports after which the offset of the work coordinates has come, which is in every 30th at least."""
_OUTSIDE: Final = 15


class Machine:
    """One controller. Positions are in machine coordinates; at most one axis moves at a time, by its turn."""

    def __init__(
        self,
        specs: Mapping[str, AxisSpec],
        options: GrblOptions,
        axis_options: Mapping[str, GrblAxisOptions],
        clock: Clock,
    ) -> None:
        self.turn = asyncio.Lock()
        self.homed: set[str] = set()
        self.homing: asyncio.Task[None] | None = None
        self.warnings: Sequence[str] = ()
        """What is worth knowing of its settings."""
        self.homings = 0
        """How often it has homed."""
        self._specs = specs
        self._options = options
        self._axis_options = axis_options
        self._link = Link(options, clock, self._on_alarm, self._on_restart)
        self._alarm: str | None = None
        self._mover: str | None = None
        self._moves_all = False
        self._resetting = False
        """Whether an alarm that comes is our own doing."""
        self._restarts = 0
        self._restarts_before = 0
        self._one_by_one = False
        self._latest: tuple[Report, float] | None = None

    @property
    def where(self) -> str:
        """What it is called in messages."""
        return f"the controller at {self._options.port}"

    async def open(self) -> None:
        """Connect, and see that it is what the profile describes.

        Raises DeviceLostError, and DeviceFaultError with all that is set otherwise.
        """
        self.homed.clear()
        self._alarm = self._mover = self._latest = None
        self._resetting = False
        await self._link.open()
        try:
            await self._identify()
        except BaseException:
            await self._link.close()
            raise

    async def close(self) -> None:
        """Let the port go."""
        await self._link.close()
        if self.homing is not None:
            await asyncio.wait([self.homing])
            self.homing = None

    async def report(self) -> tuple[Report, float]:
        """Return a new report, and when it was asked for; while the controller homes, the latest one.

        It answers nothing until it is homed. Raises DeviceLostError.
        """
        if self.homing is not None and self._latest is not None:
            return self._latest
        report, asked_at = self._latest = await self._link.status()
        if report.state == "Alarm" and self.homed:
            self._on_alarm(report.substate)  # one that was not heard
        return report, asked_at

    def position(self, name: str) -> float | None:
        """Return where the latest report takes an axis to be."""
        index = LETTERS.index(self._axis_options[name].letter)
        position = None if self._latest is None else self._latest[0].position
        return None if position is None or index >= len(position) else position[index]

    def fault(self, report: Report) -> str | None:
        """Return what is wrong, in words."""
        return self._alarm or words.STATES.get(report.state)

    def is_moving(self, name: str) -> bool:
        """Return whether an axis moves because it was told to; others do not, while it does."""
        return self.turn.locked() and (self._moves_all or self._mover == name)

    def others_move(self, name: str) -> bool:
        """Return whether what moves is another axis."""
        return self.turn.locked() and self._mover not in {None, name} and not self._moves_all

    async def jog(self, name: str, mode: str, value: float, velocity: float) -> None:
        """Send an axis to a position (mode G53G90) or by a distance (G91), at `velocity` (a second).

        Raises LimitError, DeviceFaultError, MotionStoppedError and DeviceLostError.
        """
        halts = self._link.halts
        self._begin(name)
        letter = self._axis_options[name].letter
        if self._latest is not None and self._latest[0].state == "Alarm" and self._alarm is None:
            await self._ask(name, "$X", halts)  # it was locked by its start, not by an alarm
        await self._ask(name, f"$J={mode}G21{letter}{value:.4f}F{velocity * 60:.3f}", halts)

    def begin_homing(self, name: str) -> None:
        """Let the controller home an axis, or all of them where it cannot do it one by one."""
        names = [name] if self._one_by_one else list(self._specs)
        self._begin(name, everything=not self._one_by_one)
        self.homed.difference_update(names)
        command = f"$H{self._axis_options[name].letter}" if self._one_by_one else "$H"
        self._link.give_up_by(RESET)
        self.homing = asyncio.ensure_future(self._home(name, command, names, self._link.halts))
        self.homing.add_done_callback(_retrieve)

    def homing_is_over(self) -> bool:
        """Return whether homing has ended. Raises why it failed, DeviceFaultError or DeviceLostError, once."""
        if self.homing is None:
            return True
        if not self.homing.done():
            return False
        homing, self.homing = self.homing, None
        homing.result()
        return True

    async def halt(self) -> None:
        """Stop whatever moves: a jog at once, homing by a reset, what others have started by a hold and a reset."""
        if self.homing is not None and not self.homing.done():
            self._resetting = True
            self._link.halt(RESET)
            await asyncio.wait([self.homing])
            await self._link.status()  # which is answered after all that the reset brings about
            self._resetting = False
            return
        self._link.halt(JOG_CANCEL)
        # A jog that is being taken in is not yet one that can be cancelled: once it is, it can.
        await self._link.settled()
        self._link.halt(JOG_CANCEL)
        report, _ = await self.report()
        if report.state == "Run" or (report.state == "Hold" and report.moving):
            await self._hold()

    def require_no_restart(self, name: str) -> None:
        """Raise DeviceFaultError where the controller has restarted since the motion began."""
        if self._restarts != self._restarts_before:
            raise self._has_restarted(name)

    async def _identify(self) -> None:
        for attempt in range(_IDENTIFY):
            try:
                info = await self._link.ask("$I")
                settings = parse_settings(await self._link.ask("$$"))
                break
            except RestartedError:
                if attempt + 1 == _IDENTIFY:
                    raise DeviceLostError(
                        f"{self.where} restarts again and again: check its supply"
                    ) from None
            except RefusedError as error:
                raise DeviceFaultError(f"{self.where} does not say how it is set: {error}") from error
        self._one_by_one = _homes_one_by_one(info)
        wrong = differences(settings, self._specs, self._axis_options)
        if wrong:
            raise DeviceFaultError(f"{self.where} is not set as the profile needs: {'; '.join(wrong)}")
        self.warnings = remarks(settings)
        await self._find_positions()

    async def _find_positions(self) -> None:
        for _ in range(_REPORTS):
            report, _ = await self.report()
            if report.position is not None:
                break
        missing = [name for name in self._specs if self.position(name) is None]
        if missing:
            letters = ", ".join(f"'{name}' ({self._axis_options[name].letter})" for name in missing)
            raise DeviceFaultError(f"{self.where} reports no position of {letters}: check their 'letter'")

    def _begin(self, name: str, *, everything: bool = False) -> None:
        self._mover, self._moves_all = name, everything
        self._restarts_before = self._restarts
        self._resetting = False

    async def _home(self, name: str, command: str, names: list[str], halts: int) -> None:
        try:
            # Whoever asked before is answered first: from here on nobody is, until it is homed.
            await self._link.status()
            await self._ask(name, command, halts, self._options.homing_timeout)
            self.homed.update(names)
            self.homings += 1
            self._alarm = None
        except DeviceFaultError:
            if not self._resetting:
                raise
        finally:
            self._link.give_up_by(JOG_CANCEL)

    async def _ask(self, name: str, line: str, halts: int, patience: float | None = None) -> None:
        try:
            await self._link.ask(line, patience, halts)
        except RestartedError:
            raise self._has_restarted(name) from None
        except RefusedError as error:
            if error.number == _OUTSIDE:
                raise LimitError(
                    f"axis '{name}' cannot go there: {error}; choose another target, or home it first, "
                    "since until then it takes itself to be at its zero"
                ) from error
            raise DeviceFaultError(f"axis '{name}': {error}") from error

    async def _hold(self) -> None:
        self._link.halt(FEED_HOLD)
        while (report := (await self.report())[0]).moving:
            pass  # reports come at their interval
        if report.state == "Hold":
            self._link.reset()  # from Hold:0 it keeps the position

    def _on_alarm(self, number: int | None) -> None:
        self.homed.clear()
        if not self._resetting:
            self._alarm = words.alarm(number)
            logger.warning("%s: %s", self.where, self._alarm)

    def _on_restart(self) -> None:
        self.homed.clear()
        self._restarts += 1
        logger.warning("%s has restarted: its axes have to be homed", self.where)

    def _has_restarted(self, name: str) -> DeviceFaultError:
        return DeviceFaultError(
            f"axis '{name}': {self._alarm}: clear what caused it and home the axis"
            if self._alarm
            else f"axis '{name}': the controller has restarted and lost its position: "
            "check its supply, and home the axis"
        )


def _homes_one_by_one(info: list[str]) -> bool:
    """Return whether `$HX` is known: by the option H of Grbl and grblHAL; FluidNC always does."""
    options = [line.partition(":")[2].split(",")[0] for line in info if line.startswith("[OPT:")]
    return any("H" in letters for letters in options) or any("FluidNC" in line for line in info)


def _retrieve(task: "asyncio.Task[None]") -> None:
    """Take note of an error that nobody waited for any more."""
    with contextlib.suppress(DriverError, asyncio.CancelledError):
        task.result()
