"""What is wrong with a picture, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees, radians
from typing import Literal

from calib.detection.edges import Edges
from calib.detection.health import Exposure, Glare, PictureHealth, TargetInPicture

DARK = 0.15  # of the full scale: paper is no brighter
LEAST_CONTRAST = 0.08  # of the full scale, between ink and paper
CLEAR_OF_NOISE = 10.0  # times the noise, between ink and paper
OVER_EXPOSED = 0.2  # of the region's pixels are saturated: paper, and not a reflection
GLARE = 0.005  # of the region, in one patch
BLURRED = 5.0  # px from 10 to 90 %
SMEARED = 4.0  # px of motion, and
SMEARED_RATIO = 1.5  # times as wide across it as along it
FINEST = {"disk": 10.0, "square": 10.0, "marker cell": 3.0}  # px
SMALLEST_AREA = 0.01  # of the picture
FLAT = radians(8)  # to the image plane

FaultKind = Literal["dark", "faint", "over_exposed", "glare", "moving", "blurred", "small", "cut_off", "flat"]


SPOILING: frozenset[FaultKind] = frozenset(
    {"dark", "faint", "over_exposed", "glare", "moving", "blurred", "small"}
)
"""Faults that make every point of a picture worse; the others say only that it might tell more."""


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong with a picture, for programs and in a sentence that says what to do."""

    kind: FaultKind
    message: str

    @property
    def spoils(self) -> bool:
        """Whether the points found in the picture are worse for it."""
        return self.kind in SPOILING


def faults(health: PictureHealth) -> list[Fault]:
    """List what is wrong, what matters most first; nothing where the picture is good to measure in."""
    found = _of_light(health.exposure, health.glare)
    if health.edges is not None:
        found += _of_edges(health.edges)
    if health.target is not None:
        found += _of_target(health.target)
    return found


def _of_light(light: Exposure, glare: Glare | None) -> list[Fault]:
    found = []
    if light.saturated > OVER_EXPOSED:
        found.append(
            Fault(
                "over_exposed",
                f"the picture is over-exposed: {_percent(light.saturated)} of the pixels are saturated; less "
                "light, or a shorter exposure",
            )
        )
    elif light.paper < DARK:
        found.append(
            Fault(
                "dark",
                f"the picture is too dark: the brightest of it is at {_percent(light.paper)} of the camera's "
                "range; more light, or a longer exposure",
            )
        )
    elif light.paper - light.ink < max(LEAST_CONTRAST, CLEAR_OF_NOISE * light.noise):
        found.append(
            Fault(
                "faint",
                f"there is little contrast: dark and bright are {_percent(light.paper - light.ink)} of the "
                f"camera's range apart, with noise of {_percent(light.noise)}; more light on the target, less "
                "on the lens, and is the lens clean?",
            )
        )
    if light.saturated <= OVER_EXPOSED and glare is not None and glare.share > GLARE:
        found.append(
            Fault(
                "glare",
                f"part of the picture is over-exposed: {glare.width:.0f} x {glare.height:.0f} px round "
                f"({glare.x:.0f}, {glare.y:.0f}) are saturated; turn the target or the lamp until nothing "
                "glares, or expose for a shorter time",
            )
        )
    return found


def _of_edges(edges: Edges) -> list[Fault]:
    if edges.smear_px > SMEARED and edges.widest_px > SMEARED_RATIO * edges.narrowest_px:
        return [
            Fault(
                "moving",
                f"the picture is smeared or double: edges are {edges.widest_px:.1f} px wide one way and "
                f"{edges.narrowest_px:.1f} px the other, as of a motion of {edges.smear_px:.1f} px at "
                f"{degrees(edges.direction):.0f} deg from the rows; wait longer for standstill, or expose for "
                "a shorter time",
            )
        ]
    width = (edges.widest_px + edges.narrowest_px) / 2
    if width > BLURRED:
        return [
            Fault(
                "blurred",
                f"the picture is blurred: edges are {width:.1f} px wide; focus, or wait longer for standstill",
            )
        ]
    return []


def _of_target(target: TargetInPicture) -> list[Fault]:
    found = []
    finest = FINEST[target.element]
    if target.element_px is not None and target.element_px < finest:
        found.append(
            Fault(
                "small",
                f"the target is small: a {target.element} is {target.element_px:.1f} px wide where it is seen "
                f"smallest, and should be {finest:.0f} px or more; go nearer, or print it larger",
            )
        )
    elif target.area < SMALLEST_AREA:
        found.append(
            Fault(
                "small",
                f"the target is small: its points span {_percent(target.area)} of the picture; go nearer, or "
                "print it larger",
            )
        )
    if target.outside:
        found.append(
            Fault(
                "cut_off",
                f"the target is cut off: {target.outside} of its {target.of} points are out of the picture; "
                "the others count",
            )
        )
    if target.tilt is not None and target.tilt < FLAT:
        found.append(
            Fault(
                "flat",
                f"the target is parallel to the image plane to {degrees(target.tilt):.0f} deg, which does not "
                "tell focal length from distance: lean it by 20 to 45 deg, at least in other views",
            )
        )
    return found


def _percent(share: float) -> str:
    percent = 100 * share
    return f"{percent:.0f} %" if percent >= 10 else f"{percent:.2g} %"
