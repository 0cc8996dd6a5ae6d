"""The axes of a profile, with every quantity as a number in the axis's own reading unit."""

from dataclasses import dataclass

from pydantic import BaseModel

from daemon.profile.devices import resolve_axis_options
from daemon.profile.lines import KeyPath
from daemon.profile.problems import Problems
from daemon.profile.tables import AxisTable, ProfileTable
from drivers.axis import AxisSpec
from drivers.quantities import ANGLE, LENGTH


@dataclass(frozen=True, slots=True)
class AxisProfile:
    """One joint of the chain and the motor behind it."""

    spec: AxisSpec
    reading_std: float | None
    """Standard deviation of a reading, in the reading unit."""
    unit_trusted: bool
    """Whether the encoder's unit is believed as a measure to verify against."""
    scale_std: float | None
    """How well that unit says the scale beforehand, relative to it."""
    controller: str
    options: BaseModel
    """An instance of the driver's `AxisOptions`."""


def resolve_axes(table: ProfileTable, problems: Problems) -> list[AxisProfile]:
    """Return the axes, noting what is wrong with them; one whose options are wrong is left out."""
    axes = []
    for index, axis in enumerate(table.axes):
        path = ("axes", index)
        if axis.name in [other.name for other in table.axes[:index]]:
            problems.add((*path, "name"), f"'{axis.name}' is the name of an axis above: choose another one")
        spec = _spec(axis, path, problems)
        _check_trust(axis, path, problems)
        std = None
        if axis.reading_std is not None:
            std = problems.reading((*path, "reading_std"), axis.reading_std, axis.reading_unit)
            if std < 0:
                problems.add((*path, "reading_std"), f"must not be negative, as {axis.reading_std} is")
        options = resolve_axis_options(index, axis, table.controllers, problems)
        if options is not None:
            axes.append(AxisProfile(spec, std, axis.unit_trusted, axis.scale_std, axis.controller, options))
    return axes


def _spec(axis: AxisTable, path: KeyPath, problems: Problems) -> AxisSpec:
    unit = axis.reading_unit
    low, high = (problems.reading((*path, "limits"), limit, unit) for limit in axis.limits)
    if low >= high:
        problems.add(
            (*path, "limits"),
            f"the lower limit {axis.limits[0]} must lie below the upper one {axis.limits[1]}",
        )
    velocity = problems.reading((*path, "velocity"), axis.velocity, unit, "/s")
    acceleration = problems.reading((*path, "acceleration"), axis.acceleration, unit, "/s2")
    tolerance = problems.reading((*path, "tolerance"), axis.tolerance, unit)
    for key, value in (("velocity", velocity), ("acceleration", acceleration), ("tolerance", tolerance)):
        if value <= 0:
            problems.add((*path, key), f"must be greater than 0, unlike {getattr(axis, key)}")
    return AxisSpec(axis.name, axis.kind, unit, (low, high), velocity, acceleration, tolerance)


def _check_trust(axis: AxisTable, path: KeyPath, problems: Problems) -> None:
    measure = ANGLE if axis.kind == "revolute" else LENGTH
    for key, trusted, instead in (
        ("unit_trusted", axis.unit_trusted, "set it to false"),
        ("scale_std", axis.scale_std is not None, "leave it out"),
    ):
        if trusted and axis.reading_unit not in measure.units:
            problems.add(
                (*path, key),
                f"{axis.reading_unit} do not measure a {axis.kind} axis by themselves: "
                f"only {', '.join(measure.units)} can be trusted; {instead}",
            )
