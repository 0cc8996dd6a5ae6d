"""What `$$` says, held against the profile."""

import re
from collections.abc import Iterable, Mapping

from drivers.axis import AxisSpec
from drivers.grbl.options import LETTERS, GrblAxisOptions

RELATIVE = 1e-3
"""How far two numbers of the same meaning may differ: Grbl rounds to three decimals."""


def parse_settings(lines: Iterable[str]) -> dict[int, float]:
    """Return the numbers of an answer to `$$`; what is no number is left out."""
    found = (re.match(r"\$(\d+)\s*=\s*(-?\d+(?:\.\d+)?)\b", line, re.ASCII) for line in lines)
    return {int(match[1]): float(match[2]) for match in found if match}


def differences(
    settings: Mapping[int, float], specs: Mapping[str, AxisSpec], options: Mapping[str, GrblAxisOptions]
) -> list[str]:
    """Return what is set otherwise than the profile needs, a sentence each; a setting that is missing is right."""
    wrong = []
    if settings.get(22, 1) == 0:
        wrong.append("homing is off ($22=0): connect limit switches and set $22=1")
    if settings.get(13, 0) != 0:
        wrong.append("it reports inches ($13=1): set $13=0")
    if settings.get(1, 255) != 255:
        wrong.append(
            f"its motors are let go {settings[1]:g} ms after a motion ($1={settings[1]:g}), "
            "and the axes with them: set $1=255"
        )
    for name, spec in specs.items():
        wrong += _of_axis(settings, spec, options[name])
    return wrong


def remarks(settings: Mapping[int, float]) -> list[str]:
    """Return what is worth knowing, and can be lived with."""
    if settings.get(20, 1) == 0:
        return [
            "its soft limits are off ($20=0), so that only activecam keeps the axes within theirs: set $20=1"
        ]
    return []


def _of_axis(settings: Mapping[int, float], spec: AxisSpec, options: GrblAxisOptions) -> list[str]:
    index, name, unit, zero = LETTERS.index(options.letter), spec.name, spec.unit, options.zero(spec)
    wrong = []
    steps, rate, ramp, travel = (settings.get(base + index) for base in (100, 110, 120, 130))
    if steps is not None and options.steps is not None and not _same(steps, options.steps):
        wrong.append(
            f"axis '{name}' has {steps:g} steps per {unit} (${100 + index}) and the profile says "
            f"{options.steps:g}: set ${100 + index}={options.steps:g}, or change 'steps'"
        )
    if rate is not None and rate < spec.velocity * 60 * (1 - RELATIVE):
        wrong.append(
            f"axis '{name}' makes at most {rate / 60:g} {unit}/s (${110 + index}={rate:g} a minute) and the profile "
            f"asks for {spec.velocity:g}: lower 'velocity', or set ${110 + index}={spec.velocity * 60:g}"
        )
    if ramp is not None and ramp < spec.acceleration * (1 - RELATIVE):
        wrong.append(
            f"axis '{name}' accelerates by {ramp:g} {unit}/s2 (${120 + index}) and the profile says "
            f"{spec.acceleration:g}: lower 'acceleration', or set ${120 + index}={spec.acceleration:g}"
        )
    low, high = (limit - zero for limit in spec.limits)
    if travel is not None and (low < -travel * (1 + RELATIVE) or high > 0) and settings.get(20, 1) != 0:
        wrong.append(
            f"axis '{name}' travels from {zero - travel:g} to {zero:g} {unit} (${130 + index}={travel:g}) and its "
            f"limits are {spec.limits[0]:g} to {spec.limits[1]:g} {unit}: change 'limits' or 'machine_zero', "
            f"or set ${130 + index}"
        )
    pull_off, mirrored = settings.get(27), int(settings.get(23, 0)) >> index & 1
    if travel is not None and pull_off is not None:
        home = zero - travel + pull_off if mirrored else zero - pull_off
        if not spec.limits[0] - spec.tolerance <= home <= spec.limits[1] + spec.tolerance:
            wrong.append(
                f"axis '{name}' stands at {home:g} {unit} after homing ($27) and its limits are {spec.limits[0]:g} "
                f"to {spec.limits[1]:g} {unit}: change 'limits' or 'machine_zero', or set $27"
            )
    return wrong


def _same(one: float, other: float) -> bool:
    return abs(one - other) <= RELATIVE * abs(other)
