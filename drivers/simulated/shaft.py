"""A joint between its motor and the camera: what the encoder sees, and what truly moves.

The motor follows motions in closed form. Play, the swing after a motion's end and the once-per-turn error
of the gear stand between it and the load, so that a camera sees what no encoder reports.
"""

import math
from collections import deque
from dataclasses import dataclass

from drivers.axis import AxisSpec
from drivers.errors import OptionsError
from drivers.quantities import in_reading_unit
from drivers.simulated.motion import Motion, rest
from drivers.simulated.options import EccentricityOptions, JointOptions, SettlingOptions

_HISTORY = 64
"""Motions remembered: a picture is rendered after its exposure, so the recent past has to be known."""


@dataclass(frozen=True, slots=True)
class Swing:
    """The decaying oscillation after a motion; the amplitude is in the reading unit."""

    amplitude: float
    omega: float
    damping: float

    @classmethod
    def from_options(cls, options: SettlingOptions, unit: str) -> "Swing":
        """Resolve the amplitude to the reading unit."""
        return cls(in_reading_unit(options.amplitude, unit), 2 * math.pi * options.frequency, options.damping)

    def at(self, since: float) -> float:
        """Return the deflection `since` seconds after a motion in the positive direction ended."""
        if since <= 0.0:
            return 0.0
        return self.amplitude * math.exp(-self.damping * self.omega * since) * math.sin(self.omega * since)


@dataclass(frozen=True, slots=True)
class Gear:
    """How a joint turns its reading into a displacement (rad or m), and what its encoder reads."""

    scale: float
    zero: float
    backlash: float
    encoder_resolution: float
    reading_noise: float
    swing: Swing | None
    eccentricity: EccentricityOptions | None

    @classmethod
    def from_options(cls, options: JointOptions, spec: AxisSpec) -> "Gear":
        """Resolve the options to the axis's reading unit; raises OptionsError where they do not fit it."""

        def reading(text: str | None) -> float:
            return 0.0 if text is None else in_reading_unit(text, spec.unit)

        if options.eccentricity is not None and spec.kind != "revolute":
            raise OptionsError(f"axis '{spec.name}' is prismatic: 'eccentricity' is for revolute joints")
        try:
            return cls(
                scale=options.scale,
                zero=reading(options.zero),
                backlash=abs(reading(options.backlash)),
                encoder_resolution=abs(reading(options.encoder_resolution)),
                reading_noise=abs(reading(options.reading_noise)),
                swing=None if options.settling is None else Swing.from_options(options.settling, spec.unit),
                eccentricity=options.eccentricity,
            )
        except ValueError as error:
            raise OptionsError(f"simulated joint of axis '{spec.name}': {error}") from error

    def displacement(self, load: float) -> float:
        """Return radians or metres of a load at `load` (reading unit)."""
        nominal = self.scale * (load + self.zero)
        if self.eccentricity is None:
            return nominal
        amplitude, phase = self.eccentricity.amplitude, self.eccentricity.phase
        return nominal + amplitude * (math.sin(nominal + phase) - math.sin(phase))


class Shaft:
    """One joint's motor and load over time, in the axis's reading unit."""

    def __init__(self, gear: Gear, position: float = 0.0) -> None:
        self.gear = gear
        self._past: deque[tuple[Motion, float]] = deque(maxlen=_HISTORY)
        """Motions, each with where the load was when it began."""
        self.place(position, -math.inf)

    @property
    def motion(self) -> Motion:
        """The latest motion, over or not."""
        return self._past[-1][0]

    def place(self, position: float, t: float) -> None:
        """Put the motor at `position` at rest, in the middle of its play, and forget what was before `t`."""
        self._past.clear()
        self._past.append((rest(position, t), position))

    def drive(self, motion: Motion) -> None:
        """Let the motor follow `motion`, which begins where the motor is."""
        self._past.append((motion, self._dragged(motion.began)))

    def motor(self, t: float) -> float:
        """Return where the motor is, which is what an ideal encoder reads."""
        return self._at(t)[0].position(t)

    def load(self, t: float) -> float:
        """Return where the load is, in the same unit: dragged through the play, and swinging."""
        return self._dragged(t) + self._swinging(t)

    def displacement(self, t: float) -> float:
        """Return the joint's true displacement (rad or m)."""
        return self.gear.displacement(self.load(t))

    def _at(self, t: float) -> tuple[Motion, float]:
        return next((entry for entry in reversed(self._past) if entry[0].began <= t), self._past[0])

    def _dragged(self, t: float) -> float:
        motion, before = self._at(t)
        half = 0.5 * self.gear.backlash
        position = motion.position(t)
        # The play operator: exact because every motion goes in one direction.
        return min(max(before, position - half), position + half)

    def _swinging(self, t: float) -> float:
        swing = self.gear.swing
        if swing is None:
            return 0.0
        # A motion that another one superseded has no end to swing after.
        followed_at = [*(motion.began for motion, _ in self._past), math.inf][1:]
        return sum(
            motion.direction * swing.at(t - motion.ends)
            for (motion, _), superseded in zip(self._past, followed_at, strict=True)
            if motion.direction and motion.ends <= min(t, superseded)
        )
