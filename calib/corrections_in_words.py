"""What is corrected, and what could be, in words for people."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from calib.session import Joint
from calib.stated_corrections import StatedCorrections, TargetWarp

FLAT = "the target's warp: the data do not tell it from a flat one, and it is taken for flat"


def corrections_in_words(
    stated: StatedCorrections, joints: Sequence[Joint], points: NDArray[np.float64]
) -> list[str]:
    """Return a sentence for each correction; `points` (t, 3) are the flat target's."""
    units, sentences = {joint.name: joint.reading_unit for joint in joints}, []
    for gap in stated.backlash:
        size = size_in_words(2 * abs(gap.half_gap), 2 * (gap.half_gap_std or 0), units[gap.joint])
        sentences.append(
            f"{gap.joint}: backlash of {size} between the directions of approach, taken into account"
        )
    for wave in stated.once_per_turn:
        height = float(np.hypot(wave.cosine, wave.sine))
        deviation = float(np.hypot(wave.cosine_std or 0, wave.sine_std or 0))
        size = size_in_words(height, deviation, units[wave.joint])
        sentences.append(
            f"{wave.joint}: an error of up to {size} that returns every turn, taken into account"
        )
    for share in stated.coupling:
        size = size_in_words(share.factor, share.factor_std or 0, units[share.joint])
        sentences.append(
            f"{share.joint}: moves by {size} with each {units[share.by]} of {share.by}, taken into account"
        )
    if stated.target_warp is not None:
        bulge = 1e3 * float(np.ptp(stated.target_warp.bulge(points)))
        deviation = 1e3 * max(stated.target_warp.heights_std or [0.0])
        sentences.append(
            f"the target is {size_in_words(bulge, deviation, 'mm')} from flat, taken into account"
        )
    for one in stated.aspect:
        size = size_in_words(1e2 * one.aspect, 1e2 * (one.aspect_std or 0), "%")
        sentences.append(
            f"{one.camera}: the poses given for it have the target too far out in y by {size}, taken into account"
        )
    return sentences


def unused_warp_in_words(warp: Mapping[str, float], points: NDArray[np.float64]) -> list[str]:
    """Return a sentence where a warp, by the height (m) of each shape, would explain much and was not asked for."""
    if not warp:
        return []
    seems = TargetWarp(shapes=list(warp), heights=list(warp.values()))
    bulge = 1e3 * float(np.ptp(seems.bulge(points)))
    return [
        f"the target seems to be {bulge:.2g} mm from flat: "
        "mount it on something flat, or solve again with --target-warp"
    ]


def size_in_words(value: float, deviation: float, unit: str) -> str:
    """Return a value with its standard deviation, as many digits of either as mean anything."""
    if deviation <= 0:
        return f"{value:.3g} {unit}"
    decimals = max(0, 1 - int(np.floor(np.log10(deviation))))
    return f"{value:.{decimals}f} {unit} (+-{deviation:.{decimals}f})"
