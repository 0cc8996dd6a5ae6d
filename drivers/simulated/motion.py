"""A motion of a motor as a closed form of time: constant accelerations one after another.

Positions are in any one unit, times in seconds of the rig's clock. Since the motion is a function of time,
its state can be asked at any instant, past or to come, and nothing has to be stepped.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Phase:
    """A stretch of constant acceleration, by its state when it begins."""

    began: float
    position: float
    velocity: float
    acceleration: float

    def position_at(self, t: float) -> float:
        """Return the position at `t`, as if the phase lasted for ever."""
        dt = t - self.began
        return self.position + (self.velocity + 0.5 * self.acceleration * dt) * dt

    def velocity_at(self, t: float) -> float:
        """Return the velocity at `t`, as if the phase lasted for ever."""
        return self.velocity + self.acceleration * (t - self.began)


@dataclass(frozen=True, slots=True)
class Motion:
    """A motion in one direction that ends at rest."""

    began: float
    ends: float
    start: float
    target: float
    """Where it comes to rest."""
    phases: tuple[Phase, ...] = ()

    @property
    def direction(self) -> float:
        """Return +1, -1, or 0 for a rest."""
        return math.copysign(1.0, self.target - self.start) if self.target != self.start else 0.0

    def position(self, t: float) -> float:
        """Return where the motor is at `t`."""
        if t >= self.ends:
            return self.target
        phase = self._phase(t)
        return self.start if phase is None else phase.position_at(t)

    def velocity(self, t: float) -> float:
        """Return how fast it moves at `t`, with its sign."""
        phase = None if t >= self.ends else self._phase(t)
        return 0.0 if phase is None else phase.velocity_at(t)

    def stopped(self, t: float, deceleration: float) -> "Motion":
        """Return what becomes of the motion when it is braked from `t` on."""
        position, velocity = self.position(t), self.velocity(t)
        if velocity == 0.0:
            return rest(position, t)
        time = abs(velocity) / deceleration
        brake = Phase(t, position, velocity, -math.copysign(deceleration, velocity))
        return Motion(t, t + time, position, position + 0.5 * velocity * time, (brake,))

    def _phase(self, t: float) -> Phase | None:
        return next((phase for phase in reversed(self.phases) if phase.began <= t), None)


def rest(position: float, t: float) -> Motion:
    """Return the motion that stands at `position` from `t` on."""
    return Motion(t, t, position, position)


def trapezoid(start: float, target: float, t: float, velocity: float, acceleration: float) -> Motion:
    """Return the fastest motion from rest to rest that keeps to both limits, begun at `t`.

    The velocity rises and falls linearly, with a plateau where the distance allows for one.
    """
    distance = abs(target - start)
    peak = min(velocity, math.sqrt(distance * acceleration))
    ramp = peak / acceleration
    if t + ramp == t:
        return rest(target, t)  # a distance too short to take any time
    sign = math.copysign(1.0, target - start)
    cruise = max(0.0, distance / peak - ramp)
    rise = Phase(t, start, 0.0, sign * acceleration)
    plateau = Phase(t + ramp, start + sign * 0.5 * peak * ramp, sign * peak, 0.0)
    fall_began = t + ramp + cruise
    fall = Phase(fall_began, plateau.position + sign * peak * cruise, sign * peak, -sign * acceleration)
    return Motion(t, fall_began + ramp, start, target, (rise, plateau, fall))
