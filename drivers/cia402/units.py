"""From the axis's reading unit to the drive's own units of position, velocity and acceleration.

A drive tells its units, if at all, in objects 0x60A8 to 0x60AA, by codes of CiA 303-2: a power of ten, a unit, and
for rates a unit of time. Where they are increments, the objects for feed, gear and encoder tell how
many make a turn of the shaft.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

from drivers.axis import AxisSpec
from drivers.errors import OptionsError
from drivers.quantities import ANGLE, LENGTH

Family = Literal["length", "angle", "increments"]

_UNITS: Final[Mapping[int, tuple[Family, float]]] = MappingProxyType(
    {
        0x01: ("length", 1.0),
        0x10: ("angle", 1.0),
        0x41: ("angle", math.radians(1)),
        0x42: ("angle", math.radians(1) / 60),
        0x43: ("angle", math.radians(1) / 3600),
        0xB4: ("angle", 2 * math.pi),
        0xB5: ("increments", 1.0),
    }
)
"""What a unit is, and what it is worth in metres or radians."""
_TIMES: Final[Mapping[int, float]] = MappingProxyType({0x00: 1.0, 0x03: 1.0, 0x47: 60.0, 0x57: 1.0})
"""By how much a rate in a unit of time is larger than one in seconds."""


@dataclass(frozen=True, slots=True)
class DriveUnits:
    """What a drive tells of its units; None where it does not."""

    position: int | None = None
    velocity: int | None = None
    acceleration: int | None = None
    turn: float | None = None
    """Position units for a turn of the driven shaft."""


@dataclass(frozen=True, slots=True)
class Scales:
    """How many of the drive's units make one reading unit, a second, a second squared."""

    position: float
    velocity: float
    acceleration: float


def scales(
    spec: AxisSpec,
    units: DriveUnits,
    position: float | None = None,
    velocity: float | None = None,
    acceleration: float | None = None,
) -> Scales:
    """Return the scales of an axis: those that are given, others from what the drive tells.

    Raises OptionsError where neither the profile nor the drive says enough.
    """
    if position is None:
        position = _position(spec, units)
    return Scales(
        position,
        _rate(spec, units, units.velocity, position, "velocity") if velocity is None else velocity,
        _rate(spec, units, units.acceleration, position, "acceleration")
        if acceleration is None
        else acceleration,
    )


def _position(spec: AxisSpec, units: DriveUnits) -> float:
    reading, worth = _reading(spec)
    if reading == "increments":
        return 1.0
    drive = _unit(units.position)
    if drive is not None and drive[0] == reading:
        return worth / drive[1]
    if reading == "angle" and units.turn is not None:
        return units.turn * worth / (2 * math.pi)
    raise OptionsError(
        f"axis '{spec.name}' reads {spec.unit}, and its drive does not tell what its position units are worth: "
        f"give 'counts_per_unit', the drive's position units for 1 {spec.unit}"
    )


def _rate(
    spec: AxisSpec,
    units: DriveUnits,
    code: int | None,
    position: float,
    name: Literal["velocity", "acceleration"],
) -> float:
    if not code:
        return abs(position)
    drive, time = _unit(code), _TIMES.get(code >> 8 & 0xFF)
    if drive is not None and time is not None:
        reading, worth = _reading(spec)
        if drive[0] == "increments":
            return abs(position) * time
        if drive[0] == reading:
            return worth / drive[1] * time
        if drive[0] == "angle" and units.turn is not None:
            return abs(position) / units.turn * 2 * math.pi / drive[1] * time
    raise OptionsError(
        f"axis '{spec.name}' reads {spec.unit}, and what the drive says of its {name} units (0x{code:08X}) does "
        f"not tell what they are worth: give '{name}_per_unit'"
    )


def _reading(spec: AxisSpec) -> tuple[Family, float]:
    if spec.unit in LENGTH.units:
        return "length", float(LENGTH.units[spec.unit])
    if spec.unit in ANGLE.units:
        return "angle", float(ANGLE.units[spec.unit])
    return "increments", 1.0


def _unit(code: int | None) -> tuple[Family, float] | None:
    """Return what a unit's code stands for, the power of ten included; None where it is not known."""
    if not code:
        return None
    unit = _UNITS.get(code >> 16 & 0xFF)
    if unit is None:
        return None
    exponent = code >> 24
    return unit[0], unit[1] * 10.0 ** (exponent - 256 if exponent > 127 else exponent)
