"""What a run would do, and how long its measuring would take."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Final, Literal

from daemon.errors import UnknownAxisError
from daemon.profile import Procedure, Profile
from daemon.profile.procedure import PlannedView, Readings
from daemon.rig import Rig
from daemon.rig.snapshot import AxisSnapshot
from drivers.axis import AxisSpec
from drivers.errors import NotHomedError

LOOKING: Final = 0.3
"""Seconds of life that a view's pictures take: to come, to be looked at, and to be written."""


@dataclass(frozen=True, slots=True)
class PlannedPosition:
    """A position of the plan; `readings` are in chain order and each axis's own unit."""

    position: int
    """Counts from 1, as the run's events do."""
    joint: str | None
    use: Literal["fit", "verify"]
    readings: list[float]
    seconds: float
    """About how long it takes, from the position before until its pictures are on disk."""


def starts_here(rig: Rig, joints: Sequence[str]) -> dict[str, list[float]]:
    """Return where all axes stand, in chain order, for each of the joints whose sweep is to start from there.

    Raises UnknownAxisError for a joint that is not swept, NotHomedError where the position of an axis is not known, and
    LimitError where it is beyond the limits.
    """
    swept = list(dict.fromkeys(sweep.joint for sweep in rig.profile.procedure.sweeps))
    for joint in joints:
        if joint not in swept:
            raise UnknownAxisError(
                f"the procedure has no sweep of '{joint}' that could start from here: it sweeps {', '.join(swept)}"
            )
    return {joint: [_start(axis) for axis in rig.snapshot.axes] for joint in joints}


def _start(axis: AxisSnapshot) -> float:
    """Return where an axis stands, to be gone to again."""
    if not axis.homed or axis.position is None:
        raise NotHomedError(
            f"axis '{axis.spec.name}' is not homed: home it, and go to where the sweep is to start"
        )
    low, high = axis.spec.limits
    nearest = min(max(axis.position, low), high)
    if abs(nearest - axis.position) > axis.spec.tolerance:
        axis.spec.check_target(axis.position)
    return nearest


def planned_positions(
    profile: Profile, procedure: Procedure, standing: Sequence[float | None]
) -> list[PlannedPosition]:
    """Return the positions of `procedure`, which may begin elsewhere than the profile's; the axes stand at `standing`.

    Homing is not in the estimate, nor is solving. A simulated rig's motions are as much faster as its clock.
    """
    specs = {axis.spec.name: axis.spec for axis in profile.axes}
    pace = 1.0 if profile.simulation is None else profile.simulation.time_scale
    at: Mapping[str, float | None] = dict(zip(specs, standing, strict=True))
    planned = []
    for number, (start, view) in enumerate(_with_starts(procedure), start=1):
        travel = 0.0
        if start is not None:
            travel, at = _duration(specs, at, start), start
        travel += _duration(specs, at, view.readings)
        at = view.readings
        seconds = (travel + procedure.settle) / pace + LOOKING * procedure.frames
        planned.append(PlannedPosition(number, view.joint, view.use, list(view.readings.values()), seconds))
    return planned


def _with_starts(procedure: Procedure) -> Iterator[tuple[Readings | None, PlannedView]]:
    """Yield each view, the first of a sweep with where all axes go before it."""
    views = procedure.planned_views()
    for sweep in procedure.sweeps:
        for index in range(len(sweep.readings)):
            yield (sweep.start if index == 0 else None), next(views)
    for view in views:
        yield None, view


def _duration(specs: Mapping[str, AxisSpec], start: Mapping[str, float | None], end: Readings) -> float:
    """Return how long (s) the slowest axis takes; where it stands is not known, its whole travel is taken."""
    return max(
        travel_time(
            spec, spec.limits[1] - spec.limits[0] if (begin := start[name]) is None else end[name] - begin
        )
        for name, spec in specs.items()
    )


def travel_time(spec: AxisSpec, distance: float) -> float:
    """Return how long (s) an axis takes for `distance` (reading unit), which it begins and ends at rest."""
    distance = abs(distance)
    if distance * spec.acceleration < spec.velocity**2:
        return 2 * sqrt(distance / spec.acceleration)
    return distance / spec.velocity + spec.velocity / spec.acceleration
