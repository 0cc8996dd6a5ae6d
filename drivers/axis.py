"""The contract of a motorised axis, and of the controller that drives one or more of them.

Everything about an axis is in its own reading unit (`mm`, `deg`, `counts`, `steps`, ...): positions,
limits, speeds. What a reading means in metres or radians is for the calibration to find out.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

from drivers.errors import LimitError, NotHomedError

JointKind = Literal["revolute", "prismatic"]


@dataclass(frozen=True, slots=True)
class AxisSpec:
    """What the profile says of an axis. Lengths are in the reading unit, times in seconds."""

    name: str
    kind: JointKind
    unit: str
    limits: tuple[float, float]
    velocity: float
    acceleration: float
    tolerance: float
    """How far from its target the axis may stand after a move."""

    def move_time(self, distance: float) -> float:
        """Return the time (s) that a move of `distance` may take before it counts as lost."""
        return abs(distance) / self.velocity + 2 * self.velocity / self.acceleration + 2.0

    def check_target(self, target: float) -> None:
        """Raise LimitError unless `target` is a number within the limits."""
        low, high = self.limits
        if not low <= target <= high:
            raise LimitError(
                f"axis '{self.name}' cannot go to {target:g} {self.unit}: "
                f"its limits are {low:g} to {high:g} {self.unit}; choose a target between them"
            )

    def check_jog(self, distance: float, position: float | None) -> None:
        """Raise LimitError unless a jog from `position` ends within the limits.

        Where the position is not known (None), no jog may be longer than the whole travel.
        """
        if position is not None:
            self.check_target(position + distance)
            return
        low, high = self.limits
        if not abs(distance) <= high - low:
            raise LimitError(
                f"axis '{self.name}' cannot jog by {distance:g} {self.unit}: "
                f"its whole travel is {high - low:g} {self.unit}; choose a shorter distance, or home it first"
            )


@dataclass(frozen=True, slots=True)
class AxisState:
    """What an axis reported, and when. `position` is None while the device does not know it."""

    position: float | None
    timestamp: float
    """Time of the reading on the rig's clock (s)."""
    moving: bool
    homed: bool
    fault: str | None = None

    def require_homed(self, spec: AxisSpec) -> float:
        """Return the position, or raise NotHomedError where it cannot be trusted."""
        if not self.homed or self.position is None:
            raise NotHomedError(f"axis '{spec.name}' is not homed: home it before moving it to a position")
        return self.position


@runtime_checkable
class Axis(Protocol):
    """One motorised joint.

    `move`, `jog` and `home` return only once the device itself confirms a standstill. Cancelling one of them
    stops the axis and waits for that standstill before the cancellation goes on. None of them is ever resent.
    """

    @property
    def spec(self) -> AxisSpec:
        """What the profile says of this axis."""
        ...

    async def read(self) -> AxisState:
        """Ask the device for its state; raises DeviceLostError when it does not answer."""
        ...

    async def home(self) -> None:
        """Find the axis's zero.

        Raises DeviceLostError, DeviceTimeoutError, MotionStoppedError, DeviceFaultError.
        """
        ...

    async def move(self, target: float) -> None:
        """Go to `target` (reading unit) and stand there.

        Raises LimitError and NotHomedError before anything moves; then MotionStoppedError, MotionError,
        DeviceTimeoutError, DeviceLostError, DeviceFaultError.
        """
        ...

    async def jog(self, distance: float) -> None:
        """Move by `distance` (reading unit), homed or not; a homed axis keeps to its limits."""
        ...

    async def stop(self) -> None:
        """Stop at once, whatever else is going on, and return when the axis stands."""
        ...


@runtime_checkable
class AxisController(Protocol):
    """A connection to one device, and the axes it drives. Nothing is opened before `open`."""

    @property
    def axes(self) -> Mapping[str, Axis]:
        """The axes by their names in the profile, the same before and after `open`."""
        ...

    async def open(self) -> None:
        """Connect and identify the device; moves nothing. Raises DeviceLostError."""
        ...

    async def close(self) -> None:
        """Stop the axes, confirm that they stand where that can be had, and let the device go."""
        ...
