"""From a profile's text to a checked `Profile`, or to all of its problems."""

import re
import tomllib
from pathlib import Path
from types import MappingProxyType
from typing import Any

from calib.targets import Target
from daemon.profile.axes import resolve_axes
from daemon.profile.devices import resolve_camera, resolve_controllers
from daemon.profile.errors import ProfileError
from daemon.profile.lines import scan_lines
from daemon.profile.problems import Problems
from daemon.profile.procedure import resolve_procedure
from daemon.profile.profile import Profile
from daemon.profile.simulation import check_simulation
from daemon.profile.source import ProfileText, read_profile
from daemon.profile.tables import PROFILE_FORMAT, ProfileTable
from daemon.profile.targets import TargetAlone, resolve_target


def load_profile(path_or_name: str | Path) -> Profile:
    """Read the profile at a path, or the shipped one of that name; raises ProfileError.

    The keys of each table are checked first, and how the tables fit each other only when all keys are right.
    """
    source = read_profile(path_or_name)
    document = _parse(source)
    problems = Problems(source.file, document, scan_lines(source.text))
    if document.get("format", PROFILE_FORMAT) != PROFILE_FORMAT:
        problems.add(("format",), f"must be '{PROFILE_FORMAT}', not {document['format']!r}")
        problems.raise_any()  # whatever else is unusual about it is due to that
    table = problems.validate(ProfileTable, document, ())
    problems.raise_any()
    assert table is not None
    return _resolve(table, source.path, problems)


def load_target(path_or_name: str | Path) -> Target:
    """Read the `[target]` of a profile, or of a file that holds nothing else; raises ProfileError.

    Nothing else is checked: one can look at pictures before the rest of a rig is described.
    """
    source = read_profile(path_or_name)
    document = _parse(source)
    problems = Problems(source.file, document, scan_lines(source.text))
    table = problems.validate(TargetAlone, {"target": document["target"]} if "target" in document else {}, ())
    problems.raise_any()
    assert table is not None
    return resolve_target(table.target)


def _parse(source: ProfileText) -> dict[str, Any]:
    try:
        return tomllib.loads(source.text)
    except tomllib.TOMLDecodeError as error:
        reason, _, place = str(error).rpartition(" (at ")
        found = re.match(r"line (\d+)", place)
        line = int(found[1]) if found else source.text.rstrip().count("\n") + 1  # "at end of document"
        raise ProfileError([f"{source.file}:{line}: is not TOML: {reason[:1].lower()}{reason[1:]}"]) from None


def _resolve(table: ProfileTable, path: Path | None, problems: Problems) -> Profile:
    axes = resolve_axes(table, problems)
    controllers = resolve_controllers(table.controllers, table.axes, problems)
    camera = resolve_camera(table.camera, table.axes, problems)
    target = resolve_target(table.target)
    # Positions and truth are stated in terms of the axes, so that these have to be right first.
    problems.raise_any()
    procedure = resolve_procedure(table.procedure, axes, problems)
    check_simulation(table, axes, target, problems)
    problems.raise_any()
    assert camera is not None
    return Profile(
        table.format,
        table.name,
        table.description,
        tuple(axes),
        MappingProxyType(controllers),
        camera,
        target,
        procedure,
        table.simulation,
        path,
    )
