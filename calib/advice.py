"""What the views do not tell, and what would help most, in words."""

from collections.abc import Mapping
from math import degrees
from typing import assert_never

from calib.likelihood.other_views import Change, Nearer, Sweep, Tilt, Twice
from calib.likelihood.weakness import Known, Weakness

LENS = ("focal_length", "principal_point")


def weakness_in_words(weakness: Weakness, units: Mapping[str, str]) -> str:
    """Return a sentence that says what is weak and what would make it known best; `units` are the joints' readings'."""
    return what_is_weak(weakness) + _remedy(weakness, units)


def what_is_weak(weakness: Weakness) -> str:
    """Return a sentence that names what is badly known, and how badly."""
    names = [_name(one) for one in weakness.known]
    if len(names) == 1:
        if weakness.undetermined:
            return f"the views do not tell {names[0]}"
        return f"the views tell {names[0]} to {_size(weakness.known[0])} only"
    if not weakness.undetermined:
        names = [f"{name} ({_size(one)})" for name, one in zip(names, weakness.known, strict=True)]
    return f"{', '.join(names[:-1])} and {names[-1]} can't be told apart"


def _name(known: Known) -> str:
    owner = known.quantity.owner
    return {
        "scale": f"{owner}'s scale",
        "direction": f"the direction of {owner}'s axis",
        "place": f"where {owner}'s axis lies",
        "focal_length": f"the focal length of {owner}",
        "principal_point": f"the principal point of {owner}",
        "stand": f"where {owner} stands",
        "look": f"which way {owner} looks",
    }[known.quantity.kind]


def _size(known: Known) -> str:
    """Return the standard deviation as people read it."""
    size = known.std * known.quantity.tolerance
    match known.quantity.kind:
        case "direction" | "look":
            return f"{degrees(size):.2g} deg"
        case "place" | "stand":
            return f"{1e3 * size:.2g} mm"
        case "principal_point":
            return f"{100 * size:.2g} % of the focal length"
        case _:
            return f"{100 * size:.2g} %"


def _remedy(weakness: Weakness, units: Mapping[str, str]) -> str:
    remedies = []
    if weakness.advice is not None:
        what = "them" if len(weakness.known) > 1 else "it"
        better = f"would make {what} {weakness.advice.gain:.2g} times better known"
        if weakness.undetermined:
            better = "would help most"
        remedies.append(f"{_in_words(weakness.advice.change, units)} {better}")
    if any(one.quantity.kind in LENS for one in weakness.known):
        remedies.append("known intrinsics would help too" if remedies else "give known intrinsics")
    return f": {'; '.join(remedies)}" if remedies else ""


def _in_words(change: Change, units: Mapping[str, str]) -> str:
    match change:
        case Sweep(joint, low, high, beside):
            sentence = f"sweeping {joint} from {low:.4g} to {high:.4g} {units[joint]}"
            if beside is not None:
                sentence += f" with {beside[0]} at {beside[1]:.4g} {units[beside[0]]}"
            return f"{sentence} as well"
        case Tilt(axis, turn):
            return f"tilting the target by {turn:.0f} degrees about its {axis} axis and running again"
        case Nearer():
            return "moving the target nearer by a third and running again"
        case Twice():
            return "taking every view twice"
        case _:
            assert_never(change)
