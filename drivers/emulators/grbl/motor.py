"""A stepper: what the firmware counts, and the shaft that follows as long as it loses no step."""

import math
from collections.abc import Callable

from drivers.simulated.motion import rest, trapezoid
from drivers.simulated.shaft import Shaft


class Motor:
    """One axis in machine coordinates (mm or degrees). The switch is where the shaft reads `switch`.

    What the firmware counts (`position`) and where the shaft is are different things: an open-loop motor
    that stalls or slips goes on being counted.
    """

    def __init__(self, shaft: Shaft, switch: float, now: Callable[[], float]) -> None:
        self.shaft = shaft
        self.switch = switch
        self.stalled = False
        self._losing = 0.0
        self._now = now
        self._counted = rest(0.0, -math.inf)

    @property
    def position(self) -> float:
        """Where the firmware takes it to be."""
        return self._counted.position(self._now())

    @property
    def ends(self) -> float:
        """When it stands, on the world's clock (s)."""
        return self._counted.ends

    def count_from(self, position: float) -> None:
        """Stand, and be taken to be at `position`."""
        now = self._now()
        self._counted = rest(position, now)
        self.shaft.drive(rest(self.shaft.motor(now), now))

    def go(self, target: float, velocity: float, acceleration: float) -> None:
        """Set out for `target` from rest."""
        now = self._now()
        start, shaft = self._counted.position(now), self.shaft.motor(now)
        self._counted = trapezoid(start, target, now, velocity, acceleration)
        if not self.stalled:
            reached = shaft + target - start - self._losing
            self._losing = 0.0
            self.shaft.drive(trapezoid(shaft, reached, now, velocity, acceleration))

    def brake(self, deceleration: float) -> None:
        """Slow down to rest."""
        now = self._now()
        self._counted = self._counted.stopped(now, deceleration)
        if not self.stalled:
            self.shaft.drive(self.shaft.motion.stopped(now, deceleration))

    def cut(self) -> None:
        """Stop in no time, as when the pulses cease."""
        self.count_from(self.position)

    def stall(self) -> None:
        """Turn no more, and be counted on."""
        now = self._now()
        self.shaft.drive(rest(self.shaft.motor(now), now))
        self.stalled = True

    def slip(self, distance: float) -> None:
        """Lose the steps of `distance` on the next motion: the shaft stays behind by as much, the count does not."""
        self._losing += distance

    def to_switch(self) -> float:
        """Return how far the shaft is from its switch."""
        return self.switch - self.shaft.motor(self._now())
