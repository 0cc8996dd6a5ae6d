"""The pictures that a calibration takes, as positions of all axes in their reading units."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

from daemon.profile.axes import AxisProfile
from daemon.profile.lines import KeyPath
from daemon.profile.problems import Problems
from daemon.profile.tables import ProcedureTable, SweepTable
from drivers.axis import AxisSpec

Readings = Mapping[str, float]
"""Of every axis by its name, in chain order and reading units."""


@dataclass(frozen=True, slots=True)
class PlannedView:
    """A picture to take, and where all axes stand for it."""

    joint: str | None
    """The joint exercised alone, or None for a free view."""
    readings: Readings
    use: Literal["fit", "verify"]


@dataclass(frozen=True, slots=True)
class Sweep:
    """One joint exercised alone."""

    joint: str
    start: Readings
    """Where all axes stand before the joint goes to its first reading; the others stay there."""
    readings: tuple[float, ...]
    """The joint's own, in the order in which they are taken."""
    use: Literal["fit", "verify"]
    """Whether the calibration is computed from these views, or verified on them."""


@dataclass(frozen=True, slots=True)
class FreeView:
    """A picture outside the joint-by-joint plan."""

    readings: Readings
    use: Literal["fit", "verify"]


@dataclass(frozen=True, slots=True)
class Procedure:
    """All pictures of a calibration, and the waiting around each. Times are in seconds."""

    settle: float
    """From an axis's standstill until an exposure may begin."""
    max_reading_age: float
    """Older readings are not served as a pose."""
    frame_timeout: float
    frames: int
    """How many are taken at each position, and averaged."""
    sweeps: tuple[Sweep, ...]
    views: tuple[FreeView, ...]

    def starting(self, starts: Mapping[str, Sequence[float]]) -> "Procedure":
        """Return this procedure with sweeps of some joints begun elsewhere.

        `starts` says by joint where all axes stand then, in chain order; the joint itself still begins where it would.
        That goes for its first sweep and for all that begin where the first one does, as the one that verifies it may:
        what has been put out of sight there is so for all of them.
        """
        firsts: dict[str, Readings] = {}
        sweeps = []
        for sweep in self.sweeps:
            others = {name: reading for name, reading in sweep.start.items() if name != sweep.joint}
            if sweep.joint in starts and firsts.setdefault(sweep.joint, others) == others:
                there = dict(zip(sweep.start, starts[sweep.joint], strict=True))
                there[sweep.joint] = sweep.start[sweep.joint]
                sweeps.append(replace(sweep, start=MappingProxyType(there)))
            else:
                sweeps.append(sweep)
        return replace(self, sweeps=tuple(sweeps))

    def planned_views(self) -> Iterator[PlannedView]:
        """Yield every picture in the order in which they are taken: the sweeps', then the free ones."""
        for sweep in self.sweeps:
            for reading in sweep.readings:
                yield PlannedView(sweep.joint, {**sweep.start, sweep.joint: reading}, sweep.use)
        for view in self.views:
            yield PlannedView(None, view.readings, view.use)


def resolve_procedure(table: ProcedureTable, axes: list[AxisProfile], problems: Problems) -> Procedure:
    """Return the procedure, noting positions that the axes cannot take."""
    specs = {axis.spec.name: axis.spec for axis in axes}
    sweeps = []
    for index, sweep in enumerate(table.sweeps):
        path = ("procedure", "sweeps", index)
        if sweep.joint in specs:
            sweeps.append(_sweep(sweep, path, specs, problems))
        else:
            problems.add((*path, "joint"), f"'{sweep.joint}' is not an axis; axes are {', '.join(specs)}")
    views = []
    for index, view in enumerate(table.views):
        path = ("procedure", "views", index)
        views.append(FreeView(_readings(view.readings, (*path, "readings"), specs, problems), view.use))
    return Procedure(
        settle=table.settle,
        max_reading_age=table.max_reading_age,
        frame_timeout=table.frame_timeout,
        frames=table.frames,
        sweeps=tuple(sweeps),
        views=tuple(views),
    )


def _sweep(table: SweepTable, path: KeyPath, specs: Mapping[str, AxisSpec], problems: Problems) -> Sweep:
    spec = specs[table.joint]
    if table.readings is not None:
        given = [((*path, "readings"), text) for text in table.readings]
    else:
        given = [((*path, "from"), table.first), ((*path, "to"), table.last)]
    values = [_reading(text, key, spec, problems) for key, text in given]
    if len(set(values)) < len(values):
        problems.add(given[-1][0], "a reading stands twice: a sweep takes each position once")
    if table.positions is not None:
        values = _evenly_spaced(values[0], values[1], table.positions)
    if table.both_ways:
        # The last position has no other side to come from without going beyond it.
        values = [*values, *reversed(values[:-1])]
    # The joint itself need not be told where to start: its first reading is the natural place.
    start = _readings(table.start, (*path, "start"), specs, problems, {table.joint: values[0]})
    return Sweep(table.joint, start, tuple(values), table.use)


def _readings(
    written: Mapping[str, object],
    path: KeyPath,
    specs: Mapping[str, AxisSpec],
    problems: Problems,
    natural: Readings = MappingProxyType({}),
) -> Readings:
    """Return where every axis stands: as written, else at its `natural` place, else at its 0."""
    for name in written.keys() - specs.keys():
        problems.add((*path, name), f"'{name}' is not an axis; axes are {', '.join(specs)}")
    readings = {}
    for name, spec in specs.items():
        low, high = spec.limits
        if name in written:
            readings[name] = _reading(written[name], (*path, name), spec, problems)
        elif name in natural:
            readings[name] = natural[name]
        elif low <= 0 <= high:
            readings[name] = 0.0
        else:
            unit = spec.unit
            problems.add(
                path,
                f"is incomplete: say where axis '{name}' stands, "
                f"since its 0 {unit} is outside its limits {low:g} to {high:g} {unit}",
            )
    return MappingProxyType(readings)


def _reading(text: object, path: KeyPath, spec: AxisSpec, problems: Problems) -> float:
    value = problems.reading(path, text, spec.unit)
    low, high = spec.limits
    if value < low or value > high:
        problems.add(
            path, f"{text} is outside the limits of axis '{spec.name}', {low:g} to {high:g} {spec.unit}"
        )
    return value


def _evenly_spaced(first: float, last: float, count: int) -> list[float]:
    return [first + (last - first) * index / (count - 1) for index in range(count)]
