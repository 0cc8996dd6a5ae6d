"""What a session's parameters are called, and at which values some of them are held.

pan.scale     radians or metres a reading, by nature what the unit says
pan.axis      its direction in the world (3), along growing readings
pan.point     where a revolute joint's axis goes through (3), in m
main.fx ...   a number of a camera's lens, by nature that of its known intrinsics
main.aspect   fx / fy, by nature 1
"""

import math
from typing import TYPE_CHECKING, Any

from calib.units import nominal_scale

if TYPE_CHECKING:
    from calib.session import Session

LENS_NAMES = {
    "opencv": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"),
    "division": ("fx", "fy", "cx", "cy", "k1"),
}
"""The numbers of each lens model, in the order in which they are kept."""

Held = float | list[float]
"""A number, or three."""

VECTORS = ("axis", "point")
POSITIVE = ("scale", "fx", "fy", "aspect")


def lens_paths(model: str) -> list[str]:
    """Return where a lens's numbers are in a document, in the order of `LENS_NAMES`."""
    names = LENS_NAMES[model]
    return [*names[:4], *(f"distortion.{i}" for i in range(len(names) - 4))]


def held_value(value: Any) -> Held | None:
    """Return `value` as a number, three numbers or None; raises ValueError for anything else."""
    if value is None:
        return None
    if _is_number(value):
        return float(value)
    if isinstance(value, list | tuple) and len(value) == 3 and all(map(_is_number, value)):
        return [float(number) for number in value]
    raise ValueError("must be a number, three numbers, or null")


def natural_values(session: "Session") -> dict[str, float | None]:
    """Return every parameter that may be held, and where it is held unless a value is given; None for nowhere."""
    values: dict[str, float | None] = {}
    for joint in session.joints:
        values[f"{joint.name}.scale"] = nominal_scale(joint.kind, joint.reading_unit)
        values[f"{joint.name}.axis"] = None
        if joint.kind == "revolute":
            values[f"{joint.name}.point"] = None
    for camera in session.cameras:
        known = camera.intrinsics
        lens = dict.fromkeys(LENS_NAMES["opencv"]) if known is None else known.numbers()
        values |= {f"{camera.name}.{entry}": value for entry, value in lens.items()}
        values[f"{camera.name}.aspect"] = 1.0
    return values


def held_values(session: "Session") -> dict[str, Held]:
    """Return what the session holds, and at what. Raises ValueError with a sentence that names what is wrong."""
    natural, values = natural_values(session), {}
    for name, said in session.held.items():
        if name not in natural:
            raise ValueError(f"there is no parameter '{name}' to hold; there are {', '.join(natural)}")
        value = natural[name] if said is None else said
        if value is None:
            raise ValueError(f"{name}: give the value to hold it at, which nothing else says")
        values[name] = _fitting(name, value)
    for camera in session.cameras:
        std = camera.lens_std()
        if f"{camera.name}.aspect" in values and all(
            std.get(entry) == 0 or f"{camera.name}.{entry}" in values for entry in ("fx", "fy")
        ):
            raise ValueError(f"{camera.name}.aspect: fx and fy are both known exactly, which says it already")
    return values


def _fitting(name: str, value: Held) -> Held:
    """Return `value` if the parameter `name` can have it."""
    entry = name.rpartition(".")[2]
    if isinstance(value, list):
        if entry not in VECTORS:
            raise ValueError(f"{name}: must be a single number")
        if entry == "axis" and not any(value):
            raise ValueError(f"{name}: must be a direction, not three zeros")
    elif entry in VECTORS:
        raise ValueError(f"{name}: must be three numbers")
    elif entry in POSITIVE and value <= 0:
        raise ValueError(f"{name}: must be greater than 0, unlike {value:g}")
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
