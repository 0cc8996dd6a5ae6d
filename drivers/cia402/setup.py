"""Brings a drive's parameters and a profile's together: units, velocities, limits. Nothing moves."""

from typing import Final

from drivers.axis import AxisSpec
from drivers.cia402 import objects
from drivers.cia402.options import Cia402AxisOptions
from drivers.cia402.units import DriveUnits, Scales, scales
from drivers.cia402.values import Values
from drivers.errors import OptionsError

_INT32: Final = 2**31 - 1
_COARSE: Final = 0.05
"""By what part a velocity or acceleration may be off when it is rounded to the drive's units."""


def set_up(values: Values, spec: AxisSpec, options: Cia402AxisOptions) -> Scales:
    """Write what the profile says of an axis into its drive, and return what its units are worth.

    Raises OptionsError where they do not fit each other, and what `Values` raises.
    """
    found = scales(
        spec,
        _units(values),
        options.counts_per_unit,
        options.velocity_per_unit,
        options.acceleration_per_unit,
    )
    _check_limits(values, spec, found.position)
    velocity = _rate(spec, spec.velocity, found.velocity, "velocity")
    acceleration = _rate(spec, spec.acceleration, found.acceleration, "acceleration")
    values.write_and_check(objects.PROFILE_VELOCITY, velocity)
    values.write_and_check(objects.PROFILE_ACCELERATION, acceleration)
    values.write_and_check(objects.PROFILE_DECELERATION, acceleration)
    if options.homing_method is not None:
        values.write_and_check(objects.HOMING_METHOD, options.homing_method)
    return found


def _units(values: Values) -> DriveUnits:
    return DriveUnits(
        values.read_if_there(objects.POSITION_UNIT),
        values.read_if_there(objects.VELOCITY_UNIT),
        values.read_if_there(objects.ACCELERATION_UNIT),
        _turn(values),
    )


def _turn(values: Values) -> float | None:
    """Return how many position units make a turn of the shaft; None where the drive does not tell."""
    feed = _ratio(values, objects.FEED, objects.FEED_TURNS)
    if feed is not None:
        return feed
    encoder = _ratio(values, objects.ENCODER_INCREMENTS, objects.ENCODER_TURNS)
    gear = _ratio(values, objects.GEAR_MOTOR_TURNS, objects.GEAR_SHAFT_TURNS)
    return None if encoder is None else encoder * (gear or 1.0)


def _ratio(values: Values, numerator: objects.Entry, denominator: objects.Entry) -> float | None:
    above, below = values.read_if_there(numerator), values.read_if_there(denominator)
    return above / below if above and below else None


def _rate(spec: AxisSpec, value: float, scale: float, what: str) -> int:
    units = round(value * scale)
    if abs(units - value * scale) > _COARSE * value * scale:
        raise OptionsError(
            f"axis '{spec.name}': its {what} is {value * scale:.3g} of the drive's units, which are "
            "too coarse for it: choose finer ones in the drive (objects 0x60A9 and 0x60AA)"
        )
    return units


def _check_limits(values: Values, spec: AxisSpec, scale: float) -> None:
    low, high = sorted(limit * scale for limit in spec.limits)
    if max(abs(low), abs(high)) > _INT32:
        raise OptionsError(
            f"axis '{spec.name}': its limits are more of the drive's units than fit into 32 bits"
        )
    lowest, highest = (values.read_if_there(entry) for entry in (objects.LOWEST, objects.HIGHEST))
    if lowest is None or highest is None or lowest >= highest:
        return  # the drive has no software limits, or they are switched off
    if low < lowest - 0.5 or high > highest + 0.5:
        inside = sorted((lowest / scale, highest / scale))
        raise OptionsError(
            f"axis '{spec.name}': the profile's limits {spec.limits[0]:g} to {spec.limits[1]:g} {spec.unit} "
            f"reach beyond the drive's own (object 0x607D), {inside[0]:g} to {inside[1]:g} {spec.unit}: "
            "narrow the profile's, or widen the drive's with its own tool"
        )
