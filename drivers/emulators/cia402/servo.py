"""A servo motor and its drive's power state machine, as CiA 402 has them, without the bus.

Positions on the outside are the drive's counts; inside they are readings of the axis, as the world's shafts are.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

from drivers.clock import Clock
from drivers.simulated.motion import Motion, rest, trapezoid
from drivers.simulated.shaft import Shaft

State = Literal["disabled", "ready", "on", "enabled", "quick stop", "fault"]

_STATUS: Final[dict[State, int]] = {
    "disabled": 0x0040,
    "ready": 0x0021,
    "on": 0x0023,
    "enabled": 0x0027,
    "quick stop": 0x0007,
    "fault": 0x0008,
}
_VOLTAGE, _REMOTE, _REACHED, _LIMIT, _BIT_12, _BIT_13 = 1 << 4, 1 << 9, 1 << 10, 1 << 11, 1 << 12, 1 << 13
_START, _IMMEDIATELY, _RESET, _HALT = 1 << 4, 1 << 5, 1 << 7, 1 << 8

_SWITCHING: Final = 0.02
"""Seconds that a change towards `enabled` takes; controlwords that come meanwhile go by unseen."""
_AT_PRESENT_POSITION: Final = frozenset({35, 37})
"""Homing methods that take the present position for home."""

FOLLOWING_ERROR: Final = 0x8611


@dataclass(frozen=True, slots=True)
class Mechanics:
    """How a drive is built into an axis."""

    counts: float
    """Counts for a reading unit."""
    velocity: float
    """The drive's velocity units for a reading unit a second."""
    acceleration: float
    home: float
    """Where the home switch is, in the reading unit."""
    absolute: bool = False


class Servo:
    """One motor. `parameter` returns a value of the object dictionary, `fail` is called with an error code."""

    def __init__(
        self, shaft: Shaft, mechanics: Mechanics, clock: Clock, parameter: Callable[[int, int], int]
    ) -> None:
        self._shaft = shaft
        self._mechanics = mechanics
        self._clock = clock
        self._parameter = parameter
        self.on_error: Callable[[int], None] = lambda _: None
        self.acknowledges = True
        self.modes = {0, 1, 6}
        self.can_home = True
        self.halts = True
        self.interlock = False
        """Whether something keeps the motor from being enabled."""
        self.set_point_delay = 0.0
        """Seconds after which a set-point is looked at, while bit 10 still speaks of the last motion."""
        self.cause_persists = False
        """Whether a fault comes back as soon as it is reset."""
        self._stall_next = False
        self.power_up()

    def power_up(self) -> None:
        """Come up after the power was off: disabled, and knowing no position but an absolute encoder's."""
        now = self._clock.now()
        self._stand(now)
        self.state: State = "disabled"
        self.mode = 0
        self.error_code = 0
        self._word = 0
        self._zero = 0.0 if self._mechanics.absolute else self._shaft.motor(now)
        """The reading at which the drive counts 0."""
        self._becoming: tuple[State, float] | None = None
        """The state that the drive is about to be in, and when it will be."""
        self._demand = self._shaft.motion
        self._next: float | None = None
        """Where to go when the motion under way has come to its end."""
        self._halted_from: float | None = None
        self._acknowledged = False
        self._beyond = False
        self._homing = False
        self._home_found = False
        self._homing_failed = False
        self._off_since: float | None = None
        self._stuck_from: float | None = None
        self._set_point_due: float | None = None

    def enter(self, mode: int) -> None:
        """Change the mode, where there is such a one."""
        if mode in self.modes:
            self.mode = mode

    def stall(self) -> None:
        """Let the motion under way, or else the next one, get stuck half way through what is left of it."""
        now = self._clock.now()
        if now < self._demand.ends:
            self._stuck_from = (now + self._demand.ends) / 2
        else:
            self._stall_next = True

    def fail(self, code: int) -> None:
        """Stop, go into fault, and say why."""
        self._stand(self._clock.now())
        self._becoming = None
        self.state, self.error_code = "fault", code
        self.on_error(code)

    def open_enable_input(self) -> None:
        """Lose the enable signal: the motor is switched off, and the drive does not call that a fault."""
        self._leave("disabled", self._clock.now())

    @property
    def position(self) -> int:
        """The encoder's count."""
        return round((self._shaft.motor(self._clock.now()) - self._zero) * self._mechanics.counts)

    @property
    def velocity(self) -> int:
        """The speed in the drive's units."""
        now = self._clock.now()
        sign = 1 if self._mechanics.counts > 0 else -1
        return round(sign * self._shaft.motion.velocity(now) * self._mechanics.velocity)

    @property
    def statusword(self) -> int:
        """State and bits."""
        word = _STATUS[self.state] | _VOLTAGE | _REMOTE
        if self.state != "enabled":
            return word
        now = self._clock.now()
        standing = now >= self._demand.ends and self._next is None
        window = self._parameter(0x6067, 0) / abs(self._mechanics.counts)
        if standing or abs(self._demand.target - self._shaft.motor(now)) < window:
            word |= _REACHED
        if self.mode == 1:
            word |= (
                _BIT_12 * self._acknowledged | _LIMIT * self._beyond | _BIT_13 * (self._off_since is not None)
            )
        elif self.mode == 6:
            word |= _BIT_12 * (self._home_found and standing) | _BIT_13 * self._homing_failed
        return word

    def command(self, word: int) -> None:
        """Take a controlword in."""
        now = self._clock.now()
        self._finish_switching(now)
        if self._becoming is not None and word & 0x86 == 0x06:
            return  # still changing its state, and not told to give that up
        rising, falling = word & ~self._word, self._word & ~word
        self._word = word
        if self.state == "fault":
            if rising & _RESET and not self.cause_persists:
                self.state, self.error_code = "disabled", 0
                self.on_error(0)
            return
        was_enabled = self.state == "enabled"
        self._switch(word, now)
        if self.state == "enabled" and was_enabled:
            self._act(word, rising, falling, now)

    def tick(self) -> None:
        """Go on with what takes time."""
        now = self._clock.now()
        self._finish_switching(now)
        if self._stuck_from is not None and now >= self._stuck_from:
            self._stuck_from = None
            self._shaft.drive(rest(self._shaft.motor(now), now))
        if self.state == "quick stop" and now >= self._demand.ends:
            self.state = "disabled"
        if self._set_point_due is not None and now >= self._set_point_due:
            self._set_point_due = None
            self._take_set_point(self._word, now)
        if self._next is not None and now >= self._demand.ends:
            target, self._next = self._next, None
            self._go(target, now)
        if self._homing and now >= self._demand.ends and self._halted_from is None:
            self._end_homing()
        self._supervise(now)

    def _switch(self, word: int, now: float) -> None:
        if not word & 0x02:
            self._leave("disabled", now)
        elif not word & 0x04:
            if self.state == "enabled":
                self.state = "quick stop"
                self._brake(0x6085, now)
            else:
                self._leave("disabled", now)
        elif self.state != "quick stop":
            wanted: State = "ready" if not word & 0x01 else "on" if not word & 0x08 else "enabled"
            order: list[State] = ["disabled", "ready", "on", "enabled"]
            here, there = order.index(self.state), order.index(wanted)
            if there > here:
                held = here == 2 and self.interlock
                # Only the shut-down command leads out of "disabled".
                if not held and (here > 0 or there == 1):
                    self._becoming = order[here + 1], now + _SWITCHING
            elif there < here:
                self._leave(wanted, now)

    def _finish_switching(self, now: float) -> None:
        if self._becoming is not None and now >= self._becoming[1]:
            self.state, self._becoming = self._becoming[0], None

    def _leave(self, state: State, now: float) -> None:
        self._becoming = None
        if self.state in {"enabled", "quick stop"}:
            self._stand(now)
        self.state = state

    def _act(self, word: int, rising: int, falling: int, now: float) -> None:
        started = bool(rising & _START)
        if self.mode == 1:
            if falling & _START:
                self._acknowledged = False
            if started and self.set_point_delay:
                self._set_point_due = now + self.set_point_delay
            elif started:
                self._take_set_point(word, now)
                started = not self._beyond
        elif self.mode == 6:
            if started:
                self._start_homing(now)
            elif falling & _START:
                self._homing = False
                self._brake(0x6084, now)
        if rising & _HALT and self.halts:
            self._halted_from = self._next if self._next is not None else self._demand.target
            self._next = self._set_point_due = None
            self._brake(0x6084, now)
        elif falling & _HALT:
            if not started and self._halted_from is not None:
                self._aim(self._halted_from, now)  # the old motion goes on
            self._halted_from = None

    def _take_set_point(self, word: int, now: float) -> None:
        counts = self._parameter(0x607A, 0)
        lowest, highest = self._parameter(0x607D, 1), self._parameter(0x607D, 2)
        self._beyond = lowest < highest and not lowest <= counts <= highest
        if self._beyond:
            return
        self._acknowledged = self.acknowledges
        target = self._zero + counts / self._mechanics.counts
        if word & _IMMEDIATELY or now >= self._demand.ends:
            self._aim(target, now)
        else:
            self._next = target

    def _aim(self, target: float, now: float) -> None:
        """Go to `target` at once; a motor that moves is braked first, since its motions go in one direction."""
        if now < self._demand.ends:
            self._brake(0x6084, now)
            self._next = target
        else:
            self._go(target, now)

    def _go(self, target: float, now: float) -> None:
        speed = self._parameter(0x6099, 1) if self._homing else self._parameter(0x6081, 0)
        self._drive(
            trapezoid(
                self._shaft.motor(now),
                target,
                now,
                speed / self._mechanics.velocity,
                self._parameter(0x6083, 0) / self._mechanics.acceleration,
            )
        )

    def _drive(self, motion: Motion) -> None:
        self._demand = motion
        self._shaft.drive(motion)
        if self._stall_next:
            self._stall_next, self._stuck_from = False, (motion.began + motion.ends) / 2

    def _brake(self, deceleration: int, now: float) -> None:
        slope = self._parameter(deceleration, 0) / self._mechanics.acceleration
        self._demand = self._demand.stopped(now, slope)
        actual = self._shaft.motion
        if now < actual.ends:
            self._shaft.drive(actual.stopped(now, slope))

    def _stand(self, now: float) -> None:
        here = rest(self._shaft.motor(now), now)
        self._shaft.drive(here)
        self._demand = here
        self._next = self._halted_from = self._off_since = self._stuck_from = None
        self._set_point_due = None
        self._homing = self._acknowledged = False

    def _start_homing(self, now: float) -> None:
        self._homing, self._home_found, self._homing_failed = True, False, False
        at_present = self._parameter(0x6098, 0) in _AT_PRESENT_POSITION
        self._aim(self._shaft.motor(now) if at_present else self._mechanics.home, now)

    def _end_homing(self) -> None:
        self._homing = False
        if not self.can_home:
            self._homing_failed = True
            return
        self._home_found = True
        offset = self._parameter(0x607C, 0) / self._mechanics.counts
        self._zero = self._shaft.motor(self._clock.now()) - offset

    def _supervise(self, now: float) -> None:
        """Go into fault where the motor has been away from its demand for too long."""
        off = abs(self._demand.position(now) - self._shaft.motor(now)) * abs(self._mechanics.counts)
        if self.state != "enabled" or off <= self._parameter(0x6065, 0):
            self._off_since = None
        elif self._off_since is None:
            self._off_since = now
        elif now - self._off_since > self._parameter(0x6066, 0) / 1000:
            self.fail(FOLLOWING_ERROR)
