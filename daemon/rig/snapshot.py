"""What is known of the rig at one instant: immutable, and read by everybody without touching hardware."""

from dataclasses import dataclass
from typing import Literal

from drivers.axis import AxisSpec

Side = Literal[-1, 0, 1]
"""From which an axis came to where it stands: 1 from below, -1 from above, 0 where that is not known."""


@dataclass(frozen=True, slots=True)
class AxisSnapshot:
    """The latest of one axis. `position` and the spec are in the axis's reading unit."""

    spec: AxisSpec
    controller: str
    position: float | None = None
    """None while the axis does not know where it is."""
    timestamp: float | None = None
    """Time of the reading on the rig's clock (s); None before the first."""
    number: int = 0
    """How many times the axis has been read."""
    moving: bool = False
    homed: bool = False
    approached: Side = 0
    """By its latest motion; 0 while it moves, and where a motion did not end as it was meant to."""
    fault: str | None = None
    """What the device reports as its own fault, which a person must clear."""
    lost: str | None = None
    """The driver's sentence while the device is lost; the other fields are then its last words."""
    last_error: str | None = None
    """Why the latest motion of this axis ended before its target."""


@dataclass(frozen=True, slots=True)
class DeviceSnapshot:
    """A controller or camera as a whole."""

    name: str
    kind: Literal["controller", "camera"]
    lost: str | None
    """The driver's sentence while it is lost, None while it is connected."""
    reconnects: int
    """How many times it has been found again."""
    warnings: tuple[str, ...] = ()
    """The driver's sentences on what is not as the profile asks or a calibration needs it."""


@dataclass(frozen=True, slots=True)
class RigSnapshot:
    """All axes in chain order, and the devices behind them."""

    axes: tuple[AxisSnapshot, ...]
    devices: tuple[DeviceSnapshot, ...]

    @property
    def readings(self) -> tuple[float | None, ...]:
        """The raw joint readings V, in chain order and each axis's own unit."""
        return tuple(axis.position for axis in self.axes)

    @property
    def approached(self) -> tuple[Side, ...]:
        """From which side each axis came to its reading, in chain order."""
        return tuple(axis.approached for axis in self.axes)

    @property
    def timestamp(self) -> float | None:
        """Time of the oldest of the readings on the rig's clock (s), None until all axes have been read."""
        oldest: float | None = None
        for axis in self.axes:
            if axis.timestamp is None:
                return None
            oldest = axis.timestamp if oldest is None else min(oldest, axis.timestamp)
        return oldest

    @property
    def moving(self) -> bool:
        """Whether any axis moves."""
        return any(axis.moving for axis in self.axes)

    @property
    def problems(self) -> list[str]:
        """Sentences on everything that is lost or in fault."""
        lost = [device.lost for device in self.devices if device.lost is not None]
        return lost + [
            f"axis '{axis.spec.name}': {axis.fault}"
            for axis in self.axes
            if axis.fault is not None and axis.lost is None
        ]

    def axis(self, name: str) -> AxisSnapshot:
        """Return the axis called `name`; raises KeyError."""
        for axis in self.axes:
            if axis.spec.name == name:
                return axis
        raise KeyError(name)
