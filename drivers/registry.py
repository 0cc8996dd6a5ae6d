"""Drivers by name: those of this package, and those that other installed packages add by entry points.

A package adds the driver `acme` by declaring, and needs nothing else:

    [project.entry-points."activecam.controllers"]
    acme = "acme_activecam:AcmeController"

Nothing is imported before a driver is asked for, so that start-up does not pay for drivers that a rig lacks.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType
from typing import Any, Final, Literal, cast

from pydantic import BaseModel

from drivers.driver import CameraDriver, ControllerDriver
from drivers.errors import OptionsError

DriverKind = Literal["controllers", "cameras"]

BUILT_IN: Final[Mapping[DriverKind, Mapping[str, str]]] = MappingProxyType(
    {
        "controllers": {
            "cia402": "drivers.cia402:Cia402Controller",
            "grbl": "drivers.grbl:GrblController",
            "simulated": "drivers.simulated:SimulatedController",
        },
        "cameras": {
            "replay": "drivers.video:ReplayCamera",
            "simulated": "drivers.simulated:SimulatedCamera",
            "stream": "drivers.video:StreamCamera",
            "v4l2": "drivers.video:V4l2Camera",
        },
    }
)
_REQUIRED: Final[Mapping[DriverKind, tuple[str, ...]]] = MappingProxyType(
    {"controllers": ("Options", "AxisOptions"), "cameras": ("Options",)}
)


@dataclass(frozen=True, slots=True)
class DriverInfo:
    """A driver as it is listed."""

    name: str
    kind: DriverKind
    target: str
    """`module:Class`."""
    package: str
    """The distribution that provides it."""
    error: str | None = None
    """Why it cannot be used, where it cannot."""


def controller_driver(name: str) -> type[ControllerDriver]:
    """Return the class that makes controllers of this name; raises OptionsError with those that there are."""
    return cast(type[ControllerDriver], _load("controllers", name))


def camera_driver(name: str) -> type[CameraDriver]:
    """Return the class that makes cameras of this name; raises OptionsError with those that there are."""
    return cast(type[CameraDriver], _load("cameras", name))


def names(kind: DriverKind) -> list[str]:
    """Return the names that a profile may use, in alphabetical order, without importing any driver."""
    return sorted(_candidates(kind))


def list_drivers(kind: DriverKind) -> list[DriverInfo]:
    """Import every driver and say which there are; one that cannot be imported is listed with its error."""
    infos = []
    for name, entry in sorted(_candidates(kind).items()):
        try:
            _check(kind, name, entry)
        except OptionsError as error:
            infos.append(DriverInfo(name, kind, entry.value, _package(entry), str(error)))
        else:
            infos.append(DriverInfo(name, kind, entry.value, _package(entry)))
    return infos


def _candidates(kind: DriverKind) -> dict[str, EntryPoint]:
    # A name of ours stays ours: a package that takes it too must not change what existing profiles mean.
    return {entry.name: entry for entry in entry_points(group=_group(kind))} | _built_in(kind)


def _built_in(kind: DriverKind) -> dict[str, EntryPoint]:
    return {name: EntryPoint(name, target, _group(kind)) for name, target in BUILT_IN[kind].items()}


def _group(kind: DriverKind) -> str:
    return f"activecam.{kind}"


def _load(kind: DriverKind, name: str) -> type[Any]:
    # To find a package's driver, the files of all that is installed are read.
    candidates = _built_in(kind) if name in BUILT_IN[kind] else _candidates(kind)
    if name not in candidates:
        raise OptionsError(
            f"there is no driver '{name}' for {kind}: choose one of {', '.join(sorted(candidates))}, "
            "or install the package that provides it"
        )
    return _check(kind, name, candidates[name])


def _check(kind: DriverKind, name: str, entry: EntryPoint) -> type[Any]:
    where = f"driver '{name}' ({entry.value} of {_package(entry)})"
    try:
        driver = entry.load()
    except Exception as error:  # whatever a stranger's module raises must not take the listing down
        raise OptionsError(f"{where} cannot be imported: {type(error).__name__}: {error}") from error
    for attribute in _REQUIRED[kind]:
        model = getattr(driver, attribute, None)
        if not (isinstance(model, type) and issubclass(model, BaseModel)):
            raise OptionsError(f"{where} lacks the pydantic model '{attribute}' that a driver declares")
    if not isinstance(getattr(driver, "create", None), Callable):  # type: ignore[arg-type]
        raise OptionsError(f"{where} lacks the class method 'create' that makes it")
    return cast(type[Any], driver)


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else "activecam"
